"""What recordings of a wheel say: which channels there are, what they measured, how it moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.constants import calibration_sigmas
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.signals import Signals, filled
from gritd.tools.diagnose.rig.states import at_rest, states
from gritd.tools.diagnose.rig.weights import Weights, WeightSets, weight_sets, weights_in
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the recordings of a wheel hold, run by run.

    new:      whether candidates act; not in the runs of a reference campaign.
    channels: those that carry information.
    motions:  on the analysis grid; each campaign's time begins with its first run.
    sets:     the set of weights that each value has.
    idle:     where channel torque is compared as the loss between motor and axle, the values (n,)
        at which it is the motor's alone; else None.
    """

    signals: Sequence[Signals]
    new: Sequence[bool]
    channels: tuple[str, ...]
    weights: Sequence[Weights]
    motions: Sequence[Motion]
    sets: WeightSets
    idle: Sequence[Bools] | None

    @property
    def loss(self) -> bool:
        """Whether channel torque is the loss between two torques."""
        return self.idle is not None

    @property
    def stated(self) -> bool:
        """Whether all runs state their weights."""
        return all(weights.known for weights in self.weights)

    @property
    def tabled(self) -> bool:
        """Whether all recordings are tables of steady states, as they say themselves: time, place
        and wheel angle in them mean nothing. Short runs at steady speeds are none.
        """
        return all(signals.info.steady_states for signals in self.signals)

    def motions_of(self, new: bool) -> list[Motion]:
        """Those of the new campaign, or of the reference."""
        return [motion for motion, n in zip(self.motions, self.new, strict=True) if n == new]

    def set_of(self, new: bool) -> Index:
        """The set of weights of each value (n,) of the new campaign, or of the reference."""
        labels = [label for label, n in zip(self.sets.label, self.new, strict=True) if n == new]
        return np.concatenate(labels)


def recorded(
    signals: Sequence[Signals], settings: Settings, reference: int, read_off: bool
) -> Recorded:
    """reference: how many of the runs, the first ones, are of a reference campaign; read_off: where
    both torques are measured, channel torque is the loss between them.
    """
    weights = weights_in(signals, settings)
    channels = channels_of(signals, settings, [w.known for w in weights])
    new = [number >= reference for number in range(len(signals))]

    began = {
        which: min(s.start for s, n in zip(signals, new, strict=True) if n == which)
        for which in set(new)
    }
    motions = [
        motion_of(s, w.values, settings, s.start - began[n])
        for s, w, n in zip(signals, weights, new, strict=True)
    ]
    sets = weight_sets(weights)
    loss = read_off and loss_measured(signals, channels)
    idle = idle_values(signals, motions, settings) if loss else None
    return Recorded(signals, new, channels, weights, motions, sets, idle)


def channels_of(
    signals: Sequence[Signals], settings: Settings, weights_known: Sequence[bool]
) -> tuple[str, ...]:
    """Channels that some recording has and that carry information."""
    source = {"torque": "current"}
    channels = []
    for channel in ("torque", "axle_torque", "drawbar_pull", "side_force", "sinkage", "load"):
        there = any(_varies(s.analogue.get(source.get(channel, channel))) for s in signals)
        drives = channel == "load" and not all(weights_known)
        known = there and calibration_sigmas(settings, channel)[1] < TUNING.rig.unknown_offset
        if known and not drives:
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
    turned = [{n: -v for n, v in s.analogue.items() if n == "side_force"} for s in signals]
    return [replace(s, analogue=s.analogue | t) for s, t in zip(signals, turned, strict=True)]


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
        wheel_acceleration=filled(signals.wheel_acceleration),
        carriage_position=travel - travel[0],
        carriage_speed=np.where(rest, 0.0, carriage_speed),
        load=weights,
        pass_number=float(signals.info.pass_number),
        start_position=signals.info.start_position,
        temperature=None if temperature is None else filled(temperature),
    )


def idle_values(
    signals: Sequence[Signals], motions: Sequence[Motion], settings: Settings
) -> list[Bools]:
    """Where the wheel stands or is lifted, and the axle's torque is nil; (n,) of each run. What the
    motor draws there it loses, and the noise of the axle's sensor need not be added to it.
    """
    axles = [np.nan_to_num(measured_of(one, "axle_torque", 1.0)) for one in signals]
    every = [states(motion, settings) for motion in motions]
    driven = np.concatenate([a[driving] for a, (driving, _, _) in zip(axles, every, strict=True)])
    least = TUNING.rig.holding * float(np.sqrt(np.mean(driven**2))) if driven.size else 0.0

    made = []
    for axle, (_, resting, lifted) in zip(axles, every, strict=True):
        idle = np.zeros(axle.size, bool)
        for state in (resting, lifted):
            edges = np.flatnonzero(np.diff(state.astype(int), prepend=0, append=0))
            for first, end in edges.reshape(-1, 2):
                idle[first:end] = abs(float(np.mean(axle[first:end]))) < least
        made.append(idle)
    return made
