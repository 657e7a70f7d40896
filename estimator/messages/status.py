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
    # the filter is updated, but not believed: c, tan φ and k are the stated prior
    AT_BOUND = 11  # the estimate stands at a bound that the prior calls improbable
    DIVERGED = 12  # σ was set back again and again, or is wider than the prior's
    MISMATCH = 13  # neither one soil nor a change of it explains what is measured


# what the filter is updated in
UPDATED = (Status.TRACKING, Status.AT_BOUND, Status.DIVERGED, Status.MISMATCH)


class Flag(IntFlag):
    """Conditions that may hold in addition to the status."""

    NONE = 0
    NOT_SEPARABLE = 1  # c and tan φ not distinguished by the data so far: use the joint ellipse
    K_ESTIMATED = 2  # ln k is estimated; otherwise considered
    GATED = 4  # a measurement of this window failed its gate
    RESET = 8  # covariance was inflated after the innovations disagreed
    MISMATCH = 16  # innovations larger than their stated size, or change after change of the soil
    LATE_READINGS = 32  # readings older than the horizon were dropped since the last tick
    COUNTER_JUMP = 64  # an encoder jumped and was re-baselined since the last tick
    LOAD_ASSUMED = 128  # W is the configured load, not a measurement
    CHANGED = 256  # the soil changed in the last 5 s of driving: σ was widened, c and tan φ move
    PRIOR = 512  # c, tan φ and k are the stated prior: the filter's own estimate is not believed
    TORQUE_OFF = 1024  # with MISMATCH: the torque is what disagrees …
    DRAWBAR_PULL_OFF = 2048  # … or the drawbar pull


CHANNEL_BITS = {
    "wheel_encoder": 1,
    "carriage_encoder": 2,
    "sinkage_pot": 4,
    "motor_shunt": 8,
    "wrench": 16,
    "motor_temperature": 32,
}
