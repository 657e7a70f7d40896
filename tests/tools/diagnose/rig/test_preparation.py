"""How well a bed can be prepared again is known by who prepares it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gritd.estimator.config.settings import BedSettings, Repeatability
from gritd.tools.diagnose.rig.constants import preparation
from gritd.tools.diagnose.tuning import TUNING
from tests.tools.diagnose.campaigns import settings


def test_what_is_not_stated_is_as_usual() -> None:
    assert preparation(settings()) == TUNING.rig.prepared


def test_what_the_configuration_states_is_taken() -> None:
    stated = Repeatability(cohesion=0.02 * settings().soil.cohesion.value, shear_modulus=0.3)
    found = preparation(replace(settings(), bed=BedSettings("bin", stated)))
    assert found["c"] == pytest.approx(0.02)
    assert found["k"] == pytest.approx(0.3)
    assert found["tan_phi"] == TUNING.rig.prepared["tan_phi"]
