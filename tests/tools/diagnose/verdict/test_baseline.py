"""What a reference shows by itself acts in both campaigns, and what is new is more of it or another
thing.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.method import first_answer, fit_base
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import begin, search_models
from gritd.tools.diagnose.verdict.baseline import baseline_effects, shown_as_well, shown_unsurely
from gritd.tools.diagnose.verdict.decide import decide
from gritd.tools.diagnose.verdict.decision import Decision
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long

LAG = make("contact_relaxation", {"forces": 1.0, "sinkage": 1.0, "length": 0.06})
BEGINNING = make("running_in", {"pull": 0.3, "shallow": 0.3, "torque": 0.3, "length": 0.06})
PULLS = (0.3, 0.1, 0.2)
RIPPLE = make("gear_ripple", {"ripple_cos": 0.2, "order": 23.0})
HAD = ConfiguredEffect(
    "contact_relaxation",
    {
        "forces": Uncertain(1.0, 3.0),
        "sinkage": Uncertain(1.0, 3.0),
        "length": Uncertain(0.06, 0.02),
    },
)


def pair() -> Rig:
    """Two campaigns of three runs, nothing acting."""
    before, after = record(plan(seed=3), ()), record(plan(seed=4), ())
    return wheel_rig([*before, *after], settings(), len(before), "same")


def test_it_acts_in_both_and_its_parameters_are_constants() -> None:
    plain = pair()
    having = plain.having([HAD])
    more = [c.name for c in having.constants[len(plain.constants) :]]
    assert more == [f"contact_relaxation.{name}" for name in HAD.parameters]

    known, own = np.zeros(len(plain.constants)), np.zeros(len(having.constants))
    acting = Stack(plain).predict(known, (LAG,), everywhere=True)
    np.testing.assert_allclose(Stack(having).predict(own), acting)

    longer = own.copy()
    longer[having.constants.index(having.constants[-1])] = 1.0
    other = replace(LAG, length=0.08)
    shown = Stack(plain).predict(known, (other,), everywhere=True)
    np.testing.assert_allclose(Stack(having).predict(longer), shown)


def test_more_of_it_may_be_new_and_the_configuration_does_not_hold_it() -> None:
    having = pair().having([HAD])
    assert "contact_relaxation" in having.effects
    assert "contact_relaxation" not in [effect.name for effect in having.baseline]


def test_the_reference_alone_is_its_runs_and_a_campaign_without_one_has_none() -> None:
    both = pair()
    assert both.reference is not None
    alone = both.reference()
    assert alone.reference is None and all(alone.new)
    for own, run in zip(alone.runs, both.runs[:3], strict=True):
        assert own.name == run.name
        for channel in alone.channels:
            np.testing.assert_array_equal(own.measured[channel], run.measured[channel])


def decided(*effects: Effect, quick: bool = True) -> tuple[Rig, Decision]:
    """On a campaign without a reference."""
    rig = wheel_rig(record(plan(seed=3), effects), settings())
    with first_answer() if quick else nullcontext():
        return rig, decide(search_models(prepare_screening(fit_base(rig))))


def test_a_lag_lasts_if_nothing_could_stand_in_its_place() -> None:
    rig, decision = decided(LAG)
    (found,) = baseline_effects(rig, decision)
    assert found.name == "contact_relaxation"
    assert abs(found.parameters["length"].value - 0.06) < 0.01
    assert found.parameters["forces"].sigma == HAD.parameters["forces"].sigma

    unsure = replace(decision, groups={"contact_relaxation": ("sensor_latency",)})
    assert baseline_effects(rig, unsure) == ()


def test_a_heat_that_begins_anew_in_every_run_lasts() -> None:
    rig, decision = decided(make("motor_heating", {"fall": 0.2}))
    assert [effect.name for effect in baseline_effects(rig, decision)] == ["motor_heating"]


@pytest.mark.parametrize("loss", [0.0, 0.006])
def test_what_a_run_begins_with_is_no_news_and_hides_none(loss: float) -> None:
    """A wheel that is set down otherwise each time; beside it a small friction that is new."""
    friction = (make("coulomb_friction", {"loss": loss}),) if loss else ()
    runs = []
    for seed, new in ((3, ()), (4, friction)):
        begins = [replace(BEGINNING, pull=p, torque=p) for p in PULLS]
        each = [record(plan(seed=seed), (one, *new)) for one in begins]
        runs += [begun[number] for number, begun in enumerate(each)]
    rig = wheel_rig(runs, settings(), 3, "same")
    assert begin(prepare_screening(fit_base(rig))).first.alarmed == bool(loss)


def test_what_goes_with_the_day_does_not() -> None:
    rig, decision = decided(make("drying_cohesion", {"change": 0.6, "duration": 100.0}))
    assert decision.best.names == ("drying_cohesion",)
    assert baseline_effects(rig, replace(decision, groups={"drying_cohesion": ()})) == ()


def test_a_ripple_has_another_phase_in_each_run() -> None:
    rig, decision = decided(RIPPLE)
    assert decision.best.names == ("gear_ripple",)
    assert baseline_effects(rig, decision) == ()


def test_nothing_is_had_where_nothing_alarms() -> None:
    rig, decision = decided(quick=False)
    assert decision.verdict == "consistent" and baseline_effects(rig, decision) == ()


def both_with(before: tuple[Effect, ...], after: tuple[Effect, ...]) -> tuple[Rig, Decision]:
    """Two campaigns of three runs, and what is decided of the first alone."""
    runs = [*record(plan(seed=3), before), *record(plan(seed=4), after)]
    return wheel_rig(runs, settings(), 3, "same"), decided(*before)[1]


def test_what_the_reference_does_not_tell_alone_is_no_news_if_it_explains_both() -> None:
    rig, of_reference = both_with((LAG,), (LAG,))
    base = fit_base(rig)
    (known,) = shown_unsurely(base, of_reference)
    assert known.name == "contact_relaxation"
    assert rig.having is not None
    again = fit_base(rig.having([known]))
    assert shown_unsurely(again, of_reference) == ()


def test_what_the_reference_does_not_show_is_news() -> None:
    friction = make("coulomb_friction", {"loss": 0.3})
    rig, of_reference = both_with((), (friction,))
    base = fit_base(rig)
    with first_answer():
        decision = decide(search_models(prepare_screening(base)))
    assert decision.best.names == ("coulomb_friction",)
    assert shown_unsurely(base, of_reference) == shown_as_well(base, decision.best) == ()
