"""What `--apply` writes of δ beside a soil."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.model.learnt import CHANNELS
from gritd.tools.diagnose.explain.apply import rewritten
from gritd.tools.diagnose.explain.learnt import _ends, _parted
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long


def test_soil_at_its_bound_is_correlated_with_nothing() -> None:
    """A cohesion that is held at 0 has no width: that must not end a diagnosis."""
    covariance = np.array([[4.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    sigma, correlation = _parted(covariance)
    np.testing.assert_allclose(sigma, [2.0, 1.0, 1.0])
    np.testing.assert_allclose(correlation, [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]])


def test_the_domain_stays_where_conditions_are() -> None:
    """A wheel that turns on the spot has slip 1, not 1.02; loads and speeds are positive."""
    assert _ends(np.array([0.1, 1.0]), -1.0, 1.0)[1] == 1.0
    assert _ends(np.array([-1.0, 0.3]), -1.0, 1.0)[0] == -1.0
    assert _ends(np.array([0.1, 0.6]), -1.0, 1.0) == pytest.approx((0.08, 0.62), abs=0.011)
    assert _ends(np.array([0.001, 0.1]))[0] == 1e-4
    assert _ends(np.array([20.0, 100.0]))[0] == pytest.approx(18.0, abs=0.5)


def _bent(signals: Signals, by: float = 0.15) -> Signals:
    """The same run without motor and torque sensor; its pull bends with slip as no listed effect
    has it, by a share.
    """
    rim = settings().wheel.radius * np.maximum(signals.wheel_speed, 1e-6)
    slip = 1.0 - settings().pulley_radius * signals.carriage_rate / rim
    kept = {n: v for n, v in signals.analogue.items() if n not in ("current", "axle_torque")}
    bend = 1.0 + by * np.sin(2.0 * np.pi * np.clip(slip, 0.0, 1.0))
    return replace(signals, analogue={**kept, "drawbar_pull": bend * kept["drawbar_pull"]})


def test_a_rig_without_torque_learns_its_form_and_is_diagnosed_with_it() -> None:
    """`--apply` writes δ of what was measured, and of torque none; the file loads; the same rig
    diagnosed with it has nothing new.
    """
    first, later = ([_bent(s) for s in record(plan(seed=n, seconds=30.0), ())] for n in (3, 4))
    found = diagnose(wheel_rig(first, settings()), quick=True)
    assert found.verdict != "consistent"
    assert found.learnt is not None

    stated = config.load(packaged())
    applied = config.loads(rewritten(stated.text, stated, found), "applied", packaged().parent)
    form = applied.settings.discrepancy
    assert form is not None
    by_name = dict(zip(CHANNELS, form.channels, strict=True))
    assert by_name["torque"] is None
    assert by_name["drawbar_pull"] is not None and by_name["drawbar_pull"].size > 0.0

    known = replace(applied.settings, effects=())
    rig = wheel_rig(later, known)
    assert rig.held is not None and "torque" not in rig.channels
    assert diagnose(rig, quick=True).verdict == "consistent"
    without = wheel_rig(later, replace(known, discrepancy=None))
    assert diagnose(without, quick=True).verdict != "consistent"

    # a little more of what is off already is no news; much more is
    assert _verdict(0.19, known) == "consistent"
    assert _verdict(0.25, known) == "unlisted"


def _verdict(by: float, known: Settings) -> str:
    runs = [_bent(s, by) for s in record(plan(seed=4, seconds=30.0), ())]
    return diagnose(wheel_rig(runs, known), quick=True).verdict
