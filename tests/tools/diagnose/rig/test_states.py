"""Which values count: nothing next to a start, a stop, a reversal or a touch-down, on either side
alike.
"""

from __future__ import annotations

import numpy as np

from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.states import states, turned_back, turning
from gritd.tools.diagnose.tuning import TUNING
from tests.tools.diagnose.campaigns import diagnosed, plan, settings

STEP = 0.1  # [s]
SPEED = 0.3  # [rad/s]


def _motion(speed: Array, load: Array | float = 70.0) -> Motion:
    radius = settings().wheel.radius
    return Motion(
        time=STEP * np.arange(speed.size),
        wheel_angle=np.cumsum(speed) * STEP,
        wheel_speed=speed,
        carriage_position=np.cumsum(speed) * STEP * radius * 0.8,
        carriage_speed=speed * radius * 0.8,
        load=np.broadcast_to(load, speed.shape),
    )


def _levels(*parts: tuple[float, float]) -> Array:
    """Stretches of (seconds, value)."""
    return np.concatenate([np.full(round(seconds / STEP), value) for seconds, value in parts])


def _apart(counted: Bools, at: float) -> tuple[float, float]:
    """Time from the last value that counts before an instant, and to the first after it [s]."""
    time = STEP * np.arange(counted.size)
    return at - time[counted & (time < at)].max(), time[counted & (time >= at)].min() - at


def test_a_stop_is_left_out_before_it_and_a_start_after_it() -> None:
    driving, resting, _ = states(_motion(_levels((8, SPEED), (3, 0.0), (8, SPEED))), settings())
    before, _ = _apart(driving, 8.0)
    _, after = _apart(driving, 11.0)
    assert before >= TUNING.rig.settling
    assert after >= 0.7 / SPEED - STEP
    assert resting.any() and not (driving & resting).any()


def test_a_reversal_is_a_stop_and_a_start() -> None:
    """Even where no value of the grid is slow."""
    driving, _, _ = states(_motion(_levels((8, SPEED), (8, -SPEED))), settings())
    before, after = _apart(driving, 8.0)
    assert before >= TUNING.rig.settling and after >= TUNING.rig.settling


def test_a_wheel_set_down_while_it_turns_has_to_settle() -> None:
    driving, _, lifted = states(
        _motion(np.full(160, SPEED), _levels((8, 0.0), (8, 70.0))), settings()
    )
    time = STEP * np.arange(160)
    assert time[lifted].max() <= 8.0 - TUNING.rig.settling
    assert time[driving].min() >= 8.0 + 0.7 / SPEED - STEP


def test_the_ends_of_a_recording_are_no_stops() -> None:
    driving, _, _ = states(_motion(np.full(100, SPEED)), settings())
    assert driving.all()


def test_runs_that_end_by_stopping_give_no_alarm() -> None:
    """Wheel and carriage stop at their own paces; no rate-dependent soil is found in that."""
    found = diagnosed(plan(stop=True))
    assert found.verdict == "consistent", found.summary


def test_a_wheel_turns_back_where_it_turned_the_other_way_before() -> None:
    """A rest between the two changes nothing; a start from rest is no reversal."""
    speed = np.repeat([0.0, SPEED, 0.0, -SPEED, 0.0, -SPEED, SPEED], 20)
    back = turned_back(_motion(speed), settings())
    stretches = [bool(part[2:-2].all()) for part in np.split(back, 7)]
    assert stretches == [False, False, False, True, False, False, True]
    assert not back[speed == 0.0].any()


def test_a_wheel_that_speeds_up_turns_and_one_that_starts_or_stops_does_not() -> None:
    speed = np.concatenate((np.zeros(20), np.linspace(0.0, SPEED, 20), np.zeros(20)))
    turns = turning(_motion(speed), settings())
    assert turns[23:38].all()
    assert not turns[:21].any() and not turns[39:].any()
