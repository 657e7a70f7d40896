"""Other forms of an effect: what it does may follow over an arc of rolling."""

from __future__ import annotations

import numpy as np

from gritd.estimator.effects import make
from gritd.estimator.stages.history import followed, run_begins
from gritd.tools.diagnose.fit.bending import _following
from gritd.tools.diagnose.rig.interface import Stack
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def _stack() -> Stack:
    runs = record(plan(seed=3, seconds=40.0), (make("grousers", {"grip": 0.2}),))
    return Stack(WheelRig(runs, settings()))


def test_an_effect_that_follows_is_within_its_freedom() -> None:
    """A step of what an effect does, one radian of rolling behind, is a combination of the
    columns; and they hold nothing where the effect has stood long enough.
    """
    stack = _stack()
    group = np.asarray(stack.run * len(stack.rig.channels) + stack.channel, dtype=float)
    begins = run_begins(group, stack.size)
    added = np.where(stack.covariate("slip") > 0.2, 1.0, 0.5)
    columns = _following(stack, added)
    assert columns.shape == (stack.size, 2 * len(TUNING.fit.following_arcs))

    angle = stack.covariate("wheel_angle")
    turned = np.where(begins, 0.0, np.abs(np.diff(angle, prepend=angle[0])))
    behind = followed(added, -np.expm1(-turned / 1.0), group) - added
    left = behind - columns @ np.linalg.lstsq(columns, behind, rcond=None)[0]
    assert np.max(np.abs(left)) < 1e-9
    assert np.max(np.abs(behind)) > 0.2


def test_every_run_and_channel_begins_anew() -> None:
    stack = _stack()
    columns = _following(stack, np.ones(stack.size))
    for channel, number in stack.parts:
        own = np.flatnonzero(stack.of(channel) & (stack.run == number))
        np.testing.assert_allclose(columns[own[0], 1::2], -1.0)
        np.testing.assert_allclose(columns[own, 0::2], 0.0, atol=1e-12)
