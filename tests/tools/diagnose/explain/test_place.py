"""Where the misfit lives: change points where something starts or stops, none where it drifts,
words with numbers.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.explain.locate import locate, unmoved
from gritd.tools.diagnose.explain.result import Location
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.screening import Screening, prepare_screening
from gritd.tools.proof.ours.cases import draw, record
from tests.tools.diagnose.campaigns import plan
from tests.tools.diagnose.unlisted import NextDoor

pytestmark = pytest.mark.long

PATCH = {"friction_change": -0.15, "centre": 0.2, "length": 0.1}


def prepared(rig: Rig) -> Screening:
    return prepare_screening(fit_base(rig))


def explained(screening: Screening, effect: Effect) -> Model:
    """The fit with an effect, from where it is."""
    free = free_of((type(effect),))
    at = [
        (getattr(effect, f.parameter.name) - f.parameter.centre) / f.parameter.sigma for f in free
    ]
    start = screening.base.fitted.u
    fitted = screening.problem.descend((type(effect),), free, start, np.array(at))
    return Model(fitted, (effect.name,))


@cache
def located(name: str, repeated: bool = False, **parameters: float) -> tuple[Location, ...]:
    """Places of the misfit that one effect makes; `repeated`: the same drive in every run, each
    another pass.
    """
    drawn = plan(loads=(70.0,) * 4 if repeated else (40.0, 70.0, 100.0), seed=3)
    if repeated:
        first = drawn.motions[0]
        again = (
            replace(first, time=np.asarray(first.time) + 40.0 * n, pass_number=1.0 + n)
            for n in range(4)
        )
        drawn = replace(drawn, motions=tuple(again))
    effect = make(name, parameters)
    screening = prepared(wheel_rig(record(drawn, (effect,)), drawn.settings))
    held = unmoved(screening, explained(screening, effect))
    return locate(screening, held, held.fitted.predicted)


def test_a_mean_is_not_told_as_a_small_wave_about_it() -> None:
    drawn = plan(loads=(40.0, 70.0, 100.0), seed=3)
    friction = make("coulomb_friction", {"loss": 1.2})
    ripple = make("gear_ripple", {"ripple_cos": 0.1, "order": 23.0})
    screening = prepared(wheel_rig(record(drawn, (friction, ripple)), drawn.settings))
    held = unmoved(screening, explained(screening, friction))
    first = locate(screening, held, held.fitted.predicted)[0]
    assert first.covariate == "constant"
    assert "while the wheel turns 1.2 N·m more than the model" in first.where


def test_a_patch_is_given_from_where_to_where() -> None:
    first = located("soil_patch", **PATCH)[0]
    assert first.covariate == "position"
    assert first.changes == pytest.approx((0.15, 0.25), abs=0.015)
    assert (
        "along the bed" in first.where
        and "than the model" in first.where
        and "% of its misfit" in first.where
    )


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("motor_heating", {"fall": 0.4, "duration": 20.0}),
        ("slip_sinkage", {"growth": 0.15}),
        ("viscous_friction", {"damping": 0.3}),
    ],
)
def test_what_drifts_or_curves_has_no_change_points(
    name: str, parameters: dict[str, float]
) -> None:
    places = located(name, **parameters)
    assert places and not [
        p for p in places if p.changes and p.covariate in ("position", "time", "slip")
    ]


def test_passes_differ_from_the_second_on() -> None:
    places = [
        p
        for p in located("multipass", repeated=True, stiffening=0.6, passes=0.5)
        if p.covariate == "run"
    ]
    assert {p.channel for p in places} >= {"axle_torque", "sinkage"}
    assert all(p.changes and p.changes[0] == 2.0 for p in places)
    assert "from run2 to run4" in places[0].where


def test_what_is_told_of_a_fit_is_told_by_no_other() -> None:
    """A wave that an accepted effect made: its chance is that beside the model that lacks it, not
    beside the fit that the search began with.
    """
    effect = NextDoor(size=0.3)
    drawn = plan(seed=3)
    screening = prepared(wheel_rig(record(drawn, (effect,)), drawn.settings))
    accepted = explained(screening, effect)
    held = unmoved(screening, accepted)

    shown = locate(screening, held, held.fitted.predicted)
    assert ("drawbar_pull", "time") in {(place.channel, place.covariate) for place in shown}
    begun_elsewhere = replace(screening, base=accepted)
    assert locate(begun_elsewhere, held, held.fitted.predicted) == shown


@pytest.mark.slow
def test_noise_alone_has_no_change_points() -> None:
    """A hundred campaigns without a left-out effect, noise of any size and colour: at most 5 % with
    a change point.
    """
    settings = config.load(packaged()).settings
    alarms = 0
    for seed in range(100):
        drawn = draw(settings, np.random.default_rng(seed))
        screening = prepared(wheel_rig(record(drawn, ()), drawn.settings))
        alarms += any(place.changes for place in locate(screening, screening.base))
    assert alarms <= 5
