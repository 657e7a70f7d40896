"""Two campaigns of a rig that is not the library's: what both do is no news, and what is new has a
name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.method import diagnose, fit_base
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.screen.usual import DRIVE
from gritd.tools.diagnose.search.search import begin
from gritd.tools.proof.ours.cases import record, record_fully, rig_of
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long

# a rig with a gear that rubs and ripples, and a wheel whose stress peaks elsewhere
HABITS = (
    make("gear_ripple", {"ripple_cos": 0.15, "ripple_sin": 0.1, "order": 23.0}),
    make("load_dependent_friction", {"arm": 0.002}),
    make("stress_peak_shift", {"share": 0.12}),
)
NEW = make("viscous_friction", {"damping": 0.8})


def with_habits(new: Sequence[Effect]) -> Rig:
    """A reference campaign with habits, and one with something new beside them."""
    before, after = (plan(seed=seed, seconds=24.0, wrench=False) for seed in (3, 4))
    return rig_of(after, (*HABITS, *new), record_fully(before, HABITS), "same")


def elsewhere(new: Sequence[Effect]) -> Rig:
    """A rig as the library has it; the new campaign is driven at two thirds of the speed."""
    before = record(plan(seed=3), ())
    after = record(plan(seed=4, pace=0.66), new)
    moved = [replace(s, name=f"new-{s.name}") for s in after]
    return wheel_rig([*before, *moved], settings(), len(before), "same")


def judged(new: Sequence[Effect]) -> Diagnosis:
    return diagnose(with_habits(new))


def test_what_both_campaigns_do_is_no_news() -> None:
    found = judged(())
    assert found.verdict == "consistent"
    assert found.reference is not None and found.reference.verdict == "explained"


def test_what_is_new_is_named_alone() -> None:
    found = judged((NEW,))
    assert found.verdict == "explained"
    assert [h.effect for h in found.hypotheses if h.accepted] == ["viscous_friction"]
    assert {place.channel for place in found.location} == {"torque"}


def test_the_runs_of_the_reference_show_what_is_usual() -> None:
    """News must be more than each of them would raise of its kind if it were new; what is usual of
    the soil is no reason to doubt what is new of the drive.
    """
    screen = begin(prepare_screening(fit_base(with_habits((NEW,))))).first
    assert screen.alarmed and screen.ratio > screen.threshold > 0.0
    usual = {kind: screen.usual.get(kind, 0.0) for kind in screen.kinds}
    assert min(usual.values()) >= 0.0
    louder = {kind: nats + screen.ratio for kind, nats in usual.items()}
    assert not replace(screen, usual=louder).alarmed
    assert replace(screen, usual={**louder, DRIVE: usual[DRIVE]}).alarmed


def test_friction_that_is_new_is_not_taken_for_one_that_the_reference_hides() -> None:
    """Frictions of both campaigns that cancel at the reference's speeds could explain any other
    loss at others. The reference shows none, and that counts.
    """
    base = fit_base(elsewhere((make("coulomb_friction", {"loss": 0.12}),)))
    both = next(n for n, f in enumerate(base.forms) if f.name == "drive in both")
    assert base.model.sizes[both] == 0

    screen = begin(prepare_screening(base)).first
    assert screen.alarmed
    assert screen.effects.gain("coulomb_friction") > screen.threshold
    assert not begin(prepare_screening(fit_base(elsewhere(())))).first.alarmed


def test_the_new_campaign_does_not_tell_the_noise_the_sizes_or_what_is_usual() -> None:
    quiet, loud = (fit_base(elsewhere(new)) for new in ((), (NEW,)))
    assert quiet.model.sizes == loud.model.sizes
    places = {f.name: number for number, f in enumerate(loud.forms)}
    changes = places["changes in both"]
    assert loud.model.sizes[changes] == 0 and loud.forms[changes].sizes.values == (0.0,)
    assert len(loud.forms[places["soil in both"]].sizes.values) > 1
    for one, other in zip(quiet.problem.noise.colours, loud.problem.noise.colours, strict=True):
        assert other.sigma == pytest.approx(one.sigma, rel=1e-3)
    assert quiet.usual is not None
    np.testing.assert_allclose(loud.usual, quiet.usual, atol=0.01)


def test_the_reference_may_be_silent_where_it_begins() -> None:
    """It tells nothing of how runs begin, and the new campaign has it."""

    def late(run: Signals) -> Signals:
        heard = {name: np.where(run.time < 21.0, np.nan, v) for name, v in run.analogue.items()}
        return replace(run, analogue=heard)

    before = record(plan(seed=3, seconds=24.0, pace=2.0, wrench=False), ())
    after = [replace(s, name=f"new-{s.name}") for s in record(plan(seed=4, wrench=False), ())]
    base = fit_base(wheel_rig([*map(late, before), *after], settings(), len(before), "same"))
    assert np.isfinite(base.model.evidence)
    assert len(base.model.sizes) == len(base.forms)
