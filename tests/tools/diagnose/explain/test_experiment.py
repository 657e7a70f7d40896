"""The next experiment: feasible, sensible for the verdict, its gain finite and less where the soil
takes it up.
"""

from __future__ import annotations

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.estimator.effects.base import EXPERIMENTS
from gritd.tools.diagnose.explain.result import Diagnosis
from tests.tools.diagnose.campaigns import diagnosed, plan
from tests.tools.diagnose.unlisted import CableChainDrag


def proposed(found: Diagnosis) -> str:
    following = found.next_experiment
    assert following is not None and following.action == EXPERIMENTS[following.key]
    assert 0.0 < following.expected_gain_nats < np.inf
    assert 0.5 < following.expected_probability <= 1.0
    assert following.separates
    return following.key


@pytest.mark.long
def test_rivals_are_told_apart_by_what_they_do_differently() -> None:
    """Without reversal a constant loss and one that differs by direction are the same; driving back
    tells.
    """
    found = diagnosed(plan(), (make("coulomb_friction", {"loss": 0.25}),))
    group = {h.effect for h in found.accepted} | set(found.accepted[0].indistinguishable_from)
    assert "asymmetric_friction" in group
    assert proposed(found) in ("reversal", "lifted_spin")
    assert set(found.next_experiment.separates) <= group  # type: ignore[union-attr]


def test_what_is_insufficient_is_made_sufficient() -> None:
    """One short noisy run at one load: what would show most of what it cannot."""
    found = diagnosed(plan(loads=(60.0,), seconds=6.0, wrench=False, noise=40.0, standstill=False))
    assert found.verdict == "insufficient"
    assert proposed(found)


@pytest.mark.long
def test_a_stranger_is_followed_up_where_it_lives() -> None:
    found = diagnosed(plan(), (CableChainDrag(size=8.0),))
    assert found.verdict == "unlisted" and proposed(found)
