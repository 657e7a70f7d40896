"""What recordings of a wheel say: which channels there are, what they measured, how it moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.constants import calibration_sigmas
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.states import at_rest
from gritd.tools.diagnose.tuning import TUNING


def channels_of(
    signals: Sequence[Signals], settings: Settings, weights_known: Sequence[bool]
) -> tuple[str, ...]:
    """Channels that some recording has and that carry information."""
    source = {"torque": "current"}
    channels = []
    for channel in ("torque", "axle_torque", "drawbar_pull", "side_force", "sinkage", "load"):
        there = any(_varies(s.analogue.get(source.get(channel, channel))) for s in signals)
        if (
            there
            and calibration_sigmas(settings, channel)[1] < TUNING.rig.unknown_offset
            and (channel != "load" or all(weights_known))
        ):
            channels.append(channel)

    return tuple(channels)


def loss_measured(signals: Sequence[Signals], channels: Sequence[str]) -> bool:
    """Whether the loss of the drive can be read off: the torque behind it is measured wherever the
    motor's is. Else some motor torque would be compared with nothing.
    """
    driven = [s for s in signals if _varies(s.analogue.get("current"))]
    both = all(_varies(s.analogue.get("axle_torque")) for s in driven)
    return both and {"torque", "axle_torque"} <= set(channels)


def to_one_side(signals: Sequence[Signals]) -> list[Signals]:
    """The side force of a campaign counted towards the side on which it acts: soil and wheel have
    no left and right.
    """
    forces = [s.analogue["side_force"] for s in signals if "side_force" in s.analogue]
    if not forces or np.nanmean(np.concatenate(forces)) >= 0.0:
        return list(signals)
    return [
        replace(s, analogue=s.analogue | {"side_force": -s.analogue["side_force"]})
        if "side_force" in s.analogue
        else s
        for s in signals
    ]


def _varies(values: Array | None) -> bool:
    return values is not None and bool(np.nanmax(values) > np.nanmin(values))


def measured_of(signals: Signals, channel: str, constant: float) -> Array:
    """A channel (n,) in its unit, NaN where it was not recorded; constant: [N·m/A], at the axle."""
    nothing = np.full(signals.time.size, np.nan)
    if channel == "torque":
        return constant * signals.analogue.get("current", nothing)
    return signals.analogue.get(channel, nothing)


def motion_of(signals: Signals, weights: Array, settings: Settings, began: float) -> Motion:
    """Motion (n,) as the encoders tell it under weights [N] (n,), time counted from `began` [s]."""
    travel = filled(signals.carriage_angle) * settings.pulley_radius
    wheel_speed = filled(signals.wheel_speed)
    carriage_speed = filled(signals.carriage_rate) * settings.pulley_radius

    rest = at_rest(settings.wheel.radius * wheel_speed, carriage_speed)
    temperature = signals.analogue.get("temperature")

    return Motion(
        time=signals.time + began,
        wheel_angle=filled(signals.wheel_angle),
        wheel_speed=np.where(rest, 0.0, wheel_speed),
        carriage_position=travel - travel[0],
        carriage_speed=np.where(rest, 0.0, carriage_speed),
        load=weights,
        pass_number=float(signals.info.pass_number),
        start_position=signals.info.start_position,
        temperature=None if temperature is None else filled(temperature),
    )


def filled(values: Array) -> Array:
    """Values (n,), NaN bridged by straight lines."""
    good = np.isfinite(values)
    at = np.arange(values.size)
    return np.interp(at, at[good], values[good]) if good.any() else np.zeros(values.size)
