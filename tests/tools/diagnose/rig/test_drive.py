"""The adapter of a drive without soil: what it recovers from a drive whose constants are known."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.noise.blur import blur_of
from gritd.tools.diagnose.rig.stack import Stack
from tests.tools.diagnose.rig.drives import (
    DAMPING,
    INERTIA,
    LOSS,
    fitted,
    log,
    rig,
)


def test_mass_and_friction_of_a_known_drive_are_recovered() -> None:
    found = fitted(rig(log()))
    assert found["inertia"] == pytest.approx(INERTIA, rel=0.005)
    assert found["damping"] == pytest.approx(DAMPING, rel=0.01)
    assert found["loss"] == pytest.approx(LOSS, rel=0.01)
    assert found["offset"] == pytest.approx(0.0, abs=0.1)
    assert found["torque_delay"] == pytest.approx(0.0, abs=2e-4)


def test_a_current_that_lags_by_two_samples_costs_nothing_but_the_delay() -> None:
    found = fitted(rig(log(late=2e-3)))
    assert found["torque_delay"] == pytest.approx(2e-3, abs=3e-4)
    assert found["inertia"] == pytest.approx(INERTIA, rel=0.01)
    assert found["damping"] == pytest.approx(DAMPING, rel=0.015)


def test_reversals_count_but_a_drive_at_rest_does_not() -> None:
    series = log()
    time, position = series["wheel_encoder"]
    stands = time > 12.0
    run = rig(series | {"wheel_encoder": (time, np.where(stands, position[12000], position))}).runs[
        0
    ]
    counted = run.used["torque"]
    assert counted[run.time < 11.5].mean() > 0.97
    assert not counted[run.time > 13.0].any()


def test_a_drive_that_sticks_is_judged_where_it_turns() -> None:
    """At every turning point it holds for a second, and its current creeps from one side of the
    friction to the other: how, no law tells.
    """
    pause, step = 1.0, 1e-3
    swings = [0.3 * np.cos(np.pi * np.arange(0.0, 1.0, step) + k * np.pi) for k in range(12)]
    holds = round(pause / step)
    position = np.concatenate([np.append(one, np.full(holds, one[-1])) for one in swings])
    speed = np.gradient(position, step)
    away = np.sign(np.concatenate([np.full(len(one) + holds, one[-1] - one[0]) for one in swings]))
    held = np.tile(np.append(np.zeros(len(swings[0])), np.linspace(0.0, 1.0, holds)), len(swings))
    noise = np.random.default_rng(4).standard_normal((2, position.size))
    time = step * np.arange(position.size)
    moves = INERTIA * np.gradient(speed, step) + DAMPING * speed + LOSS * away
    force = np.where(held > 0.0, LOSS * away * (1.0 - 2.0 * held), moves)
    series = {
        "wheel_encoder": (time, position + 1e-7 * noise[0]),
        "motor_shunt": (time, force + 0.3 * noise[1]),
    }
    found = diagnose(rig(series))
    values = {h.effect: h.parameters for h in found.hypotheses if h.accepted}
    assert set(values) == {"coulomb_friction"}
    loss = values["coulomb_friction"]["loss"]
    assert abs(loss.value - LOSS) < 2.0 * loss.sigma < LOSS


def test_what_both_sides_are_filtered_by_blurs_neither() -> None:
    stack = Stack(rig(log()))
    assert not blur_of(stack, stack.measured).any()


@pytest.mark.parametrize("hangs", [0.0, 12.0])
def test_friction_and_offset_are_named_beside_a_load_that_nobody_stated(hangs: float) -> None:
    """A weight on an arm, and a spring that no effect is: both go with the place alone."""
    series = log()
    time, position = series["wheel_encoder"]
    load = hangs * np.sin(position + 0.4) + 60.0 * position + 200.0 * position**3
    current = series["motor_shunt"][1] + load - 3.0
    found = diagnose(rig(series | {"motor_shunt": (time, current)}))
    values = {h.effect: h.parameters for h in found.hypotheses if h.accepted}
    assert found.verdict == "explained"
    assert set(values) == {"coulomb_friction", "current_offset"}
    loss = values["coulomb_friction"]["loss"]
    assert abs(loss.value - LOSS) < 2.0 * loss.sigma < LOSS


def test_a_log_that_is_too_short_is_refused_in_one_line() -> None:
    with pytest.raises(
        CommandError, match=r"to and fro: found 1\.00 s of position and current; expected 2 s"
    ):
        rig(log(seconds=1.0))
