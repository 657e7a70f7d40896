"""Readings in, one calibrated snapshot a tick out: all channels over the same window, 50 ms behind
the present.

Each channel keeps its readings sorted by stamp. A tick at t closes the window at t − horizon:
readings up to there move in, readings older than the window move out (windows.py). A reading that
comes later than the horizon allows is counted and dropped, one that comes twice is counted and
dropped, one that comes out of order but in time changes nothing: the result is that of the sorted
stream, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from typing import Any, NamedTuple

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.config.settings import Channel, Settings
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.status import CHANNEL_BITS
from gritd.estimator.wheel.windows import (
    ChannelWindow,
    Counters,
    Mean,
    MeanWindow,
    Sample,
    Slope,
    SlopeWindow,
)

PROBE = NS  # [ns] length of the windows from which another is chosen (window_choice.py)
STUCK_AFTER = int(0.34 * NS)  # [ns] a live sensor shows noise or motion sooner than this


class Measured(NamedTuple):
    """A physical quantity over the window, SI, with the standard deviation of its noise."""

    value: float
    sigma: float


NOTHING = Measured(float("nan"), 0.0)


class Snapshot(NamedTuple):
    """All channels over one window, calibrated, SI. Quantities of an absent optional sensor are NaN
    ± 0.
    """

    evaluated: int  # centre of the window [ns]
    ready: bool  # every required channel has a value
    wheel_angle: float  # [rad]
    wheel_speed: Measured  # [rad/s]
    carriage_position: float  # [m]
    carriage_speed: Measured  # [m/s]
    sinkage: Measured  # z [m]
    current: Measured  # [A]
    load: Measured  # W [N]
    drawbar_pull: Measured  # DP [N]
    axle_torque: Measured  # torque about the axle by the wrench [N·m]
    temperature: float  # [°C]
    stale: int  # CHANNEL_BITS of silent channels
    stuck: int  # CHANNEL_BITS of channels that stand still while others move


def window_at_first(settings: Settings) -> int:
    """Length of a run's first windows [ns]: the configured one, or that from which one is
    chosen.
    """
    return PROBE if settings.rates.auto else round(NS / settings.rates.update)


class Sync:
    """The sorted windows of all channels. `push` takes readings, `snapshot` closes the windows for
    one tick.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.counters = Counters()
        self.received: dict[str, int] = {}

        self._horizon = round(settings.rates.horizon * NS)
        self.length = window_at_first(settings)  # [ns]
        self._slopes = {name: self._slope_window(settings.channels[name]) for name in _ENCODERS}
        self._means = {
            name: MeanWindow(channel.noise, round(channel.latency * NS), self.length)
            for name, channel in settings.channels.items()
            if name not in _ENCODERS
        }
        self._wrench = self._wrench_windows()
        self._limits = _wrench_limits(settings)

        self._stale_after = {
            name: round(ch.stale_after * NS) for name, ch in settings.channels.items()
        }
        if settings.wrench is not None:
            self._stale_after["wrench"] = round(settings.wrench.stale_after * NS)

    def resize(self, length: int) -> None:
        """Windows of another length [ns] from the next snapshot on."""
        self.length = length
        for window in self._windows():
            window.length = length

    def samples(self) -> dict[str, list[Sample]]:
        """What each encoder read in the window."""
        return {name: list(window.inside) for name, window in self._slopes.items()}

    def _windows(self) -> tuple[ChannelWindow, ...]:
        return (*self._slopes.values(), *self._means.values(), *self._wrench.values())

    def _slope_window(self, channel: Channel) -> SlopeWindow:
        return SlopeWindow(
            channel.noise,
            round(channel.latency * NS),
            self.length,
            max_rate=channel.max_rate,
            counters=self.counters,
        )

    def _wrench_windows(self) -> dict[str, MeanWindow]:
        wrench = self.settings.wrench
        if wrench is None:
            return {}
        latency = round(wrench.latency * NS)
        noises = {"fx": wrench.force_noise, "fz": wrench.force_noise, "ty": wrench.torque_noise}
        return {axis: MeanWindow(noise, latency, self.length) for axis, noise in noises.items()}

    def memory(self) -> dict[str, Any]:
        """Everything that the readings so far have left, by name; `remember` takes it in again."""
        windows = {**self._slopes, **self._means, **self._wrench}
        return {"counters": self.counters, "received": self.received, "windows": windows}

    def remember(self, memory: Mapping[str, Any]) -> None:
        """Go on from another sync's memory. Raises ValueError where it has other channels."""
        windows = memory["windows"]
        for mine in (self._slopes, self._means, self._wrench):
            if not mine.keys() <= windows.keys():
                raise ValueError(f"no window for {', '.join(sorted(mine.keys() - windows.keys()))}")
            mine.update({name: windows[name] for name in mine})
        self.counters, self.received = memory["counters"], memory["received"]
        for window in self._slopes.values():
            window.counters = self.counters
        self.length = self._slopes["wheel_encoder"].length

    def continued(self, before: Sync) -> None:
        """Begin with empty windows where another sync ends: its counters and its encoders'
        baselines go on.
        """
        self.received = before.received
        self.counters = before.counters
        self.resize(before.length)
        for name, window in self._slopes.items():
            window.counters, window.shift = self.counters, before._slopes[name].shift

    def push(self, reading: Reading) -> None:
        """Sort one reading in. Non-finite and out-of-range values are counted and go no further."""
        name, value = reading.channel, reading.value
        self.received[name] = max(reading.received, self.received.get(name, 0))

        if name in self._slopes:
            self._push_count(reading)
        elif name in self._means:
            channel = self.settings.channels[name]
            assert not isinstance(value, tuple)
            if channel.low <= value <= channel.high:
                self._means[name].insert(reading.stamp, value, self.counters)
            else:
                self.counters.invalid += 1
        elif name == "wrench" and self._wrench:
            self._push_wrench(reading)

    def _push_count(self, reading: Reading) -> None:
        assert isinstance(reading.value, int)
        self._slopes[reading.channel].insert(reading.stamp, reading.value, self.counters)

    def _push_wrench(self, reading: Reading) -> None:
        value = reading.value
        assert isinstance(value, tuple)
        # NaN is an axis that is not measured, which Fz has to be
        too_large = [abs(v) > limit for v, limit in zip(value, self._limits, strict=True)]
        if True in too_large or isnan(value[2]):
            self.counters.invalid += 1
            return

        # the three axes share one stamp: count a late or repeated reading once
        repeated = Counters()
        for axis, component in (("fx", value[0]), ("ty", value[4])):
            if not isnan(component):  # an axis that is not measured
                self._wrench[axis].insert(reading.stamp, component, repeated)
        self._wrench["fz"].insert(reading.stamp, value[2], self.counters)

    def snapshot(self, t: int) -> Snapshot:
        """Close all windows at t − horizon [ns] and evaluate them at their common centre."""
        end = t - self._horizon
        for window in self._windows():
            window.advance(end)

        wheel = self._slopes["wheel_encoder"].slope()
        carriage = self._slopes["carriage_encoder"].slope()
        means = {name: window.mean() for name, window in self._means.items()}
        sought = [wheel, carriage, means["sinkage_pot"]]
        if self.settings.drive.torque_source == "motor_shunt":
            sought.append(means["motor_shunt"])
        angle, speed = self._encoder("wheel_encoder", wheel, 1.0)
        position, travel = self._encoder("carriage_encoder", carriage, self.settings.pulley_radius)
        temperature = means.get("motor_temperature")

        return Snapshot(
            evaluated=end - self.length // 2,
            ready=None not in sought,
            wheel_angle=angle,
            wheel_speed=speed,
            carriage_position=position,
            carriage_speed=travel,
            sinkage=self._analogue("sinkage_pot", means["sinkage_pot"]),
            current=self._analogue("motor_shunt", means["motor_shunt"]),
            load=self._axis("fz"),
            drawbar_pull=self._axis("fx"),
            axle_torque=self._axis("ty"),
            temperature=self._analogue("motor_temperature", temperature).value
            if temperature
            else float("nan"),
            stale=self._stale(t),
            stuck=self._stuck(speed, travel),
        )

    def _encoder(self, name: str, slope: Slope | None, arm: float) -> tuple[float, Measured]:
        """Position and speed of an encoder; arm is the pulley radius, or 1 for an angle."""
        if slope is None:
            return float("nan"), NOTHING
        calibration = self.settings.channels[name].calibration
        scale = calibration.scale.value * arm
        position = slope.middle * scale + calibration.offset.value * arm
        return position, Measured(slope.rate * scale, slope.rate_sigma * abs(scale))

    def _analogue(self, name: str, mean: Mean | None) -> Measured:
        if mean is None:
            return NOTHING
        calibration = self.settings.channels[name].calibration
        scale = calibration.scale.value
        return Measured(mean.value * scale + calibration.offset.value, mean.sigma * abs(scale))

    def _axis(self, axis: str) -> Measured:
        wrench = self.settings.wrench
        mean = self._wrench[axis].mean() if wrench is not None else None
        if wrench is None or mean is None or (axis == "fx" and not wrench.pulls):
            return NOTHING
        calibration = {"fx": wrench.drawbar_pull, "fz": wrench.load, "ty": wrench.torque}[axis]
        scale = calibration.scale.value
        return Measured(mean.value * scale + calibration.offset.value, mean.sigma * abs(scale))

    def _stale(self, t: int) -> int:
        """Bits of channels whose last bytes came longer ago than they may; a channel never heard of
        counts too.
        """
        return integer_sum(
            CHANNEL_BITS[name]
            for name, limit in self._stale_after.items()
            if t - self.received.get(name, -limit) > limit
        )

    def _stuck(self, wheel: Measured, carriage: Measured) -> int:
        """Bits of channels whose value does not change at all while the others show motion.

        An encoder is stuck when the other encoder moves and it does not change; a wheel that really
        stands still while the carriage moves is dragged: updates are skipped there too. A
        potentiometer, shunt or wrench is stuck when the wheel turns and not one digit of noise
        shows, or the last digit alone, to and fro; of the wrench on any axis.
        """
        turning, travelling = _moves(wheel), _moves(carriage)
        bits = 0
        if travelling and self._slopes["wheel_encoder"].frozen(STUCK_AFTER):
            bits |= CHANNEL_BITS["wheel_encoder"]

        if turning or travelling:
            for name in ("sinkage_pot", "motor_shunt"):
                window = self._means[name]
                if window.noise > 0.0 and window.frozen(STUCK_AFTER):
                    bits |= CHANNEL_BITS[name]
            if self._wrench and self._wrench_frozen():
                bits |= CHANNEL_BITS["wrench"]

        return bits

    def _wrench_frozen(self) -> bool:
        heard = [window for window in self._wrench.values() if window.inside]
        return bool(heard) and all(
            window.noise > 0.0 and window.frozen(STUCK_AFTER) for window in heard
        )


def _wrench_limits(settings: Settings) -> tuple[float, ...]:
    """Largest believable force [N] and moment [N·m] of each axis, as in WRENCH_FIELDS."""
    wrench = settings.wrench
    return () if wrench is None else (wrench.max_force,) * 3 + (wrench.max_torque,) * 3


def _moves(speed: Measured) -> bool:
    return abs(speed.value) > 4.0 * speed.sigma


_ENCODERS = ("wheel_encoder", "carriage_encoder")
