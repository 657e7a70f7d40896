"""What a sensor said, and when: the one type that crosses from the drivers into the estimator."""

from __future__ import annotations

from typing import NamedTuple

NS = 1_000_000_000  # [ns/s]

Value = int | float | tuple[float, ...]


class Reading(NamedTuple):
    """One sample of one channel, as read: counts, volts, newtons, degrees Celsius.

    stamp:    when the sample was taken [ns since the epoch, the daemon's own monotonic clock].
    channel:  a key of CHANNELS.
    value:    int (counts, unwrapped), float (volts, celsius), or the six-tuple of the wrench.
    received: when its bytes arrived [ns, same clock]; never earlier than they were sent.
    """

    stamp: int
    channel: str
    value: Value
    received: int


WRENCH_FIELDS = ("fx", "fy", "fz", "tx", "ty", "tz")  # [N, N, N, N·m, N·m, N·m]

# channel -> names of its raw fields; the recording's topic is /raw/<channel>
CHANNELS: dict[str, tuple[str, ...]] = {
    "wheel_encoder": ("count",),
    "carriage_encoder": ("count",),
    "sinkage_pot": ("volts",),
    "motor_shunt": ("volts",),
    "wrench": WRENCH_FIELDS,
    "motor_temperature": ("celsius",),
}

ENCODERS = ("wheel_encoder", "carriage_encoder")
MOTION = (*ENCODERS, "sinkage_pot")  # without which there is neither slip nor entry angle
