"""How well a bed can be prepared again is known by who prepares it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import BedSettings, Repeatability
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.constants import preparation
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import Bed, wheel_rig
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def test_what_is_not_stated_is_as_usual() -> None:
    assert preparation(settings()) == TUNING.rig.prepared


def test_what_the_configuration_states_is_taken() -> None:
    stated = Repeatability(cohesion=0.02 * settings().soil.cohesion.value, shear_modulus=0.3)
    found = preparation(replace(settings(), bed=BedSettings("bin", stated)))
    assert found["c"] == pytest.approx(0.02)
    assert found["k"] == pytest.approx(0.3)
    assert found["tan_phi"] == TUNING.rig.prepared["tan_phi"]


@pytest.mark.parametrize(("stated", "height"), [(0.0, TUNING.rig.relief), (2e-3, 2e-3)])
def test_every_run_on_a_bed_prepared_anew_has_a_surface_of_its_own(
    stated: float, height: float
) -> None:
    """Its standard deviation is as stated, in sinkage alone, and one run's says nothing of
    another's.
    """
    stack = _beside_a_reference("prepared", stated)
    surfaces = _in_sinkage_alone(stack)

    for run in range(len(stack.rig.runs)):
        own = stack.of("sinkage") & (stack.run == run)
        acting = np.any(surfaces[own] != 0.0, axis=0)
        assert not surfaces[stack.run != run][:, acting].any()
        spread = np.sqrt(np.mean(np.sum(surfaces[own] ** 2, axis=1)))
        assert spread == pytest.approx(height, rel=0.2)


def test_a_bed_that_was_not_touched_keeps_its_surface() -> None:
    assert _in_sinkage_alone(_beside_a_reference("same")).shape[1] == 0


def _in_sinkage_alone(stack: Stack) -> Array:
    """Those columns (N, k) of what every fit may be off by that act in no other channel."""
    elsewhere = np.any(stack.nuisances[~stack.of("sinkage")] != 0.0, axis=0)
    return stack.nuisances[:, ~elsewhere]


def _beside_a_reference(bed: Bed, surface: float = 0.0) -> Stack:
    known = replace(settings(), bed=BedSettings("bin", Repeatability(surface=surface)))
    return Stack(wheel_rig(record(plan(), ()) * 2, known, 1, bed))
