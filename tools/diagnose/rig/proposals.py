"""The menu of driven experiments, as motions about the middle of what was driven so far."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Menu
from gritd.tools.diagnose.tuning import TUNING

Levels = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
# factors on the middle speed, slips, factors on the middle load; the least effort first
LEVELS: Mapping[str, Levels] = {
    "standstill": ((0.0, 1.0), (0.2,), (1.0,)),
    "reversal": ((1.0, -1.0), (0.2,), (1.0,)),
    "slip_step": ((1.0,), (0.03, 0.15, 0.35, 0.7), (1.0,)),
    "speed_step": ((0.3, 1.0, 3.0), (0.2,), (1.0,)),
    "shifted_start": ((1.0,), (0.2,), (1.0,)),
    "second_pass": ((1.0,), (0.2,), (1.0,)),
    "load_step": ((1.0,), (0.2,), (0.5, 1.0, 1.6)),
    "lifted_spin": ((0.4, 1.0, 2.0, -0.4, -1.0, -2.0), (0.2,), (0.0,)),
}
MENU = Menu(
    driven=tuple(LEVELS),
    along={
        "slip": "slip_step",
        "speed": "speed_step",
        "acceleration": "speed_step",
        "load": "load_step",
        "sinkage": "load_step",
        "position": "shifted_start",
        "time": "long_run",
        "heat": "long_run",
        "run": "second_pass",
        "direction": "reversal",
        "velocity": "reversal",
        "wheel_angle": "lifted_spin",
        "constant": "lifted_spin",
    },
    otherwise="slip_step",
)


def proposed(key: str, driven: Sequence[Motion], radius: float) -> Motion:
    """The motion of one experiment: its levels in turn, each for an equal time."""
    speeds, slips, loads = LEVELS[key]
    time = np.arange(round(TUNING.rig.proposal_seconds * TUNING.rig.rate)) / TUNING.rig.rate

    speed = _middle([np.abs(m.wheel_speed) for m in driven]) * _stepped(speeds, time)
    slip = _stepped(slips, time)

    last = max(float(np.max(m.pass_number)) for m in driven)
    reached = max(float(np.max(np.asarray(m.start_position) + m.carriage_position)) for m in driven)
    travel = radius * speed * (1.0 - slip)

    return Motion(
        time=time,
        wheel_angle=np.cumsum(speed) / TUNING.rig.rate,
        wheel_speed=speed,
        carriage_position=np.cumsum(travel) / TUNING.rig.rate,
        carriage_speed=travel,
        load=_middle([m.load for m in driven]) * _stepped(loads, time),
        pass_number=last + 1.0 if key == "second_pass" else last,
        start_position=reached if key == "shifted_start" else 0.0,
    )


def _middle(values: Sequence[Array | float]) -> float:
    joined = np.concatenate([np.atleast_1d(v) for v in values])
    moving = joined[joined > TUNING.rig.creep * joined.max()] if joined.max() > 0.0 else joined
    return float(np.median(moving))


def _stepped(levels: Sequence[float], time: Array) -> Array:
    share = time / TUNING.rig.proposal_seconds
    index = np.minimum((share * len(levels)).astype(int), len(levels) - 1)
    stepped: Array = np.asarray(levels, dtype=float)[index]
    return stepped
