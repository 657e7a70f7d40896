"""What holds of a tick: why the estimate moves or stands still, conditions, and which channels."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class Status(IntEnum):
    """Why the estimate moves or stands still."""

    STARTING = 0  # not every required channel has filled a window yet
    TRACKING = 1  # the filter is updated
    STALE = 2  # a required channel is silent, or sends nothing usable
    STUCK = 3  # a channel stands still while the others move
    IN_AIR = 4  # no load, or no sinkage: nothing touches the soil
    STANDSTILL = 5  # neither wheel nor carriage moves
    STALL = 6  # the wheel digs without travel, or is blocked under current
    REVERSE = 7  # backwards: over soil it has already compacted
    BRAKING = 8  # the carriage pushes the wheel: the linearised shear displacement does not hold
    UNCERTAIN = 9  # slip or entry angle not known well enough to be worth an update
    # speed, load or sinkage changes from window to window: Eqs. 1–22 hold in steady motion
    UNSTEADY = 10


class Flag(IntFlag):
    """Conditions that may hold beside the status."""

    NONE = 0
    NOT_SEPARABLE = 1  # c and tan φ not told apart by the data so far: use the joint ellipse
    K_ESTIMATED = 2  # ln k is estimated; otherwise considered
    GATED = 4  # a measurement of this window failed its gate
    RESET = 8  # covariance was inflated after the innovations disagreed
    MISMATCH = 16  # innovations larger than their stated size: model and measurement disagree
    LATE_READINGS = 32  # readings older than the horizon were dropped since the last tick
    COUNTER_JUMP = 64  # an encoder jumped and was re-baselined since the last tick
    LOAD_ASSUMED = 128  # W is the configured load, not a measurement


CHANNEL_BITS = {
    "wheel_encoder": 1,
    "carriage_encoder": 2,
    "sinkage_pot": 4,
    "motor_shunt": 8,
    "wrench": 16,
    "motor_temperature": 32,
}
