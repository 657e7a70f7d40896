"""Waves and steps without a name: found where they are, paid for by how many are tried, and no part
of the noise.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.locate import locate
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.noise import lines
from gritd.tools.diagnose.noise.colour import Colour
from gritd.tools.diagnose.noise.saturated import Explainable
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.scans import candidates, without_harmonics
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import begin
from gritd.tools.proof.ours.cases import record
from gritd.tools.proof.ours.coloured import coloured
from tests.tools.diagnose.campaigns import plan
from tests.tools.diagnose.unlisted import NextDoor, RailJointDrag

pytestmark = pytest.mark.long

RUNS, LENGTH, STEP = 3, 250, 0.1


def stack() -> Any:
    """One channel, three runs of 25 s with pauses of unlike length, 20 mm/s along the bed."""
    run = np.repeat(np.arange(RUNS), LENGTH)
    own = np.tile(np.arange(LENGTH) * STEP, RUNS)
    known = {"speed": np.full(run.size, 0.02), "time": own + 61.7 * run, "position": 0.02 * own}
    rig = SimpleNamespace(channels=("pull",), runs=[SimpleNamespace(covariates=known)] * RUNS)
    return SimpleNamespace(
        rig=rig,
        run=run,
        time=known["time"],
        size=run.size,
        gaps=np.where(own == 0.0, np.inf, STEP),
        covariate=known.__getitem__,
        of=lambda channel: np.ones(run.size, bool),
    )


def standing(made: Any, values: Array) -> Array:
    """Columns beyond the long waves of the bed, which are always there."""
    none, nowhere = np.zeros((made.size, 0)), np.full(made.size, -1)
    always = lines._long(made, "pull").shape[1]
    return lines.standing(made, values, Explainable(np.ones((made.size, 1)), none), nowhere)[
        :, always:
    ]


def test_noise_of_any_colour_holds_no_line() -> None:
    """One channel in a hundred at each axis may; slow noise must not lose its slow part."""
    made, rng = stack(), np.random.default_rng(1)
    for colour in (Colour(1.0, 1.0, 0.0), Colour(1.0, 0.5, 0.7, 0.2), Colour(1.0, 4.0, 0.95, 0.04)):
        noise = coloured(made.gaps, 25, colour, rng)
        taken = [standing(made, noise[:, k]).shape[1] for k in range(25)]
        assert np.count_nonzero(taken) <= 2


def test_a_line_is_no_noise() -> None:
    """Less than a third of slow noise in power, with another phase in every run: it stands out, and
    where it is.
    """
    made, rng = stack(), np.random.default_rng(2)
    noise = coloured(made.gaps, 1, Colour(1.0, 0.5, 0.7, 0.2), rng)[:, 0]
    line = 0.75 * np.sin(2.0 * np.pi * made.time / 1.3 + 2.0 * made.run)
    found = standing(made, noise + line)
    assert found.shape[1] > 0
    left = line - found @ np.linalg.lstsq(found, line, rcond=None)[0]
    assert np.var(left) < 0.1 * np.var(line)


@cache
def begun(effect: type[Effect] | None, size: float) -> EffectSearch:
    """The search after its first screen."""
    drawn = plan(loads=(40.0, 70.0, 100.0), seed=3)
    rig = wheel_rig(record(drawn, (effect(size=size),) if effect else ()), drawn.settings)
    return begin(prepare_screening(fit_base(rig)))


def test_a_machine_next_door_is_heard_with_its_period() -> None:
    search = begun(NextDoor, 0.3)
    assert search.first.alarmed
    place = locate(search.screening, search.base)[0]
    assert (place.channel, place.covariate) == ("drawbar_pull", "time")
    assert "oscillates with a period of 1.70 s, ± 0.30 N" in place.where


def test_a_joint_of_the_rails_is_found_where_it_is() -> None:
    search = begun(RailJointDrag, 2.0)
    evidence = search.first.evidence
    assert search.first.alarmed
    assert max(evidence, key=lambda of: evidence[of]) == Shape(
        "drawbar_pull", ("position",), "step"
    )
    places = locate(search.screening, search.base)
    assert places[0].changes == pytest.approx((0.2,), abs=0.01)


def test_what_was_tried_is_paid_for() -> None:
    """Of noise alone no wave or step has evidence that would bear its share among all that were
    tried.
    """
    search = begun(None, 0.0)
    families = search.screening.families
    assert not search.first.alarmed
    beside = without_harmonics(search.problem, search.base.fitted)
    assert not candidates(families, search.problem, beside)
    assert all(search.first.evidence[family.shape] < 2.0 for family in families)
