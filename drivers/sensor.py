"""What a sensor kind is: a class that turns the raw values of its frames into one validated value.

A kind is one file in `drivers/sensors/` with one subclass of Sensor. A value that cannot be right
is counted as quarantined and not passed on; nothing is ever put in its place.
"""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from math import isfinite
from typing import ClassVar, NamedTuple

from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import FieldValue, Frame
from gritd.estimator.config.settings import Channel, Wrench
from gritd.estimator.messages.readings import Value
from gritd.estimator.plugins import SENSORS, plugins, refused

SensorSettings = Channel | Wrench


class SignalShape(NamedTuple):
    """What a sensor must know of a CAN signal to tell whether it can be its own."""

    name: str
    bits: int
    integer: bool  # values are integers, unscaled
    signed: bool = False
    is_float: bool = False
    scale: float = 1.0  # value = bits · scale + offset
    offset: float = 0.0


class Sensor(ABC):
    """One channel's values out of the frames of one device."""

    channel: ClassVar[str]  # a key of gritd.estimator.messages.readings.CHANNELS
    failed = ""  # why it gives no values any more: one of another package that raised

    def __init__(self, signal: str) -> None:
        self.keys: tuple[str, ...] = (signal,)  # the frames it wants
        self.quarantined = 0  # values refused as impossible
        self.incomplete = 0  # values of which a part never came
        self.turns_unknown = 0  # silences in which its counter may have wrapped
        self.readings = 0  # values passed on
        self.newest = 0  # when the last of them was taken [ns]

    @abstractmethod
    def value(self, frame: Frame) -> Value | None:
        """The value of a frame whose key is in `keys`; None if refused, or not yet complete."""

    def taken(self, frame: Frame, stamp: int) -> tuple[int, Value] | None:
        """A frame's value and when it was taken [ns]; None as `value`. stamp: of the frame [ns]."""
        value = self.value(frame)
        return None if value is None else (stamp, value)

    def elapsed(self, seconds: float) -> None:  # noqa: B027 - most sensors have no counter
        """The next frame was taken so long after the one before it [s]."""

    def reset(self) -> None:  # noqa: B027 - most sensors remember nothing
        """The device was reopened or started anew: forget what depended on its last frames."""

    def check_signals(self, signals: Sequence[SignalShape]) -> None:  # noqa: B027 - most take any
        """Raise DeviceSettingsError if these CAN signals cannot be this sensor's."""

    def sent(self, value: Value) -> tuple[FieldValue, ...]:
        """What a device sends for a value: the other way round, for a simulated testbed."""
        return value if isinstance(value, tuple) else (value,)

    def refuse(self) -> None:
        """Count a value as impossible."""
        self.quarantined += 1


class Encoder(Sensor):
    """An incremental or absolute encoder: a count that wraps both ways at `modulus`, unwrapped to
    an exact integer.

    Where the device sends turns, degrees or a scaled number, one count is `resolution` of it, or
    one bit of a scaled signal.

    The first count is taken as read. After a reset of the device the total goes on from where it
    was. After a silence in which the counter may have gone half round, nobody knows how far it
    went: the total goes on to the nearest count that the counter shows, and that is counted.
    """

    def __init__(self, settings: Channel) -> None:
        super().__init__(settings.signal)
        self.bits = settings.bits
        self.modulus = settings.modulus or 1 << settings.bits
        self._half = 0.5 * self.modulus / settings.max_rate  # [s] it takes to go half round
        self._stated = settings.modulus is not None
        self._step, self._zero = settings.resolution or 0.0, 0.0  # of the number sent
        self._signed = False
        self._total: int | None = None
        self._last: int | None = None

    def value(self, frame: Frame) -> int | None:
        count = self._count(frame.values[0]) if len(frame.values) == 1 else None
        if count is None or not self._fits(count):
            self.refuse()
            return None
        if self._total is None:
            self._total = count
        elif self._last is not None:
            self._total += modular_difference(count, self._last, self.modulus)
        self._last = count
        return self._total

    def sent(self, value: Value) -> tuple[FieldValue, ...]:
        assert isinstance(value, int)
        half = self.modulus // 2 if self._signed else 0
        count = (value + half) % self.modulus - half
        return (count * self._step + self._zero if self._step else count,)

    def _count(self, sent: FieldValue) -> int | None:
        """What was sent as a whole count; None where it is none."""
        if not self._step:
            return sent if isinstance(sent, int) else None
        steps = (sent - self._zero) / self._step
        return round(steps) if isfinite(steps) else None

    def _fits(self, count: int) -> bool:
        """Whether such a counter, signed or not, can show this count. A number that is sent rounded
        may show the modulus for zero.
        """
        return -(self.modulus // 2) <= count < self.modulus + bool(self._step)

    def elapsed(self, seconds: float) -> None:
        self.turns_unknown += self._last is not None and seconds >= self._half > 0.0

    def reset(self) -> None:
        self._last = None

    def check_signals(self, signals: Sequence[SignalShape]) -> None:
        shape = signals[0]
        if len(signals) != 1:
            raise self._wrong(f"{len(signals)} signals, expected one")
        if shape.is_float and not self._step:
            raise self._wrong(
                f"signal {shape.name} is a float; expected `resolution`, what one count is of it"
            )

        self._signed = shape.signed or (shape.is_float and not self._stated)
        if not shape.integer and not self._step:
            self._step, self._zero = shape.scale, shape.offset
        if self._stated and not shape.is_float and self.modulus > 1 << shape.bits:
            raise self._wrong(
                f"modulus is {self.modulus}, but signal {shape.name} has {shape.bits} bits"
            )
        if not self._stated and not shape.is_float and shape.bits != self.bits:
            raise self._wrong(f"bits is {self.bits}, but signal {shape.name} has {shape.bits}")

    def _wrong(self, reason: str) -> DeviceSettingsError:
        return DeviceSettingsError(f"channel {self.channel}", reason)


class Analog(Sensor):
    """A converter's reading as a float; NaN, infinity and what lies outside [low, high] are
    refused.
    """

    def __init__(self, settings: Channel) -> None:
        super().__init__(settings.signal)
        self.low = settings.low
        self.high = settings.high

    def check_signals(self, signals: Sequence[SignalShape]) -> None:
        if len(signals) != 1:
            names = ", ".join(signal.name for signal in signals)
            raise DeviceSettingsError(
                f"channel {self.channel}", f"its signals are {names}, expected one signal"
            )

    def value(self, frame: Frame) -> float | None:
        value = frame.values[0]
        if len(frame.values) != 1 or not within(value, self.low, self.high):
            self.refuse()
            return None
        return float(value)


def modular_difference(count: int, last: int, modulus: int) -> int:
    """count − last of a counter that wraps at `modulus`, as the step of smallest size."""
    half = modulus // 2
    return (count - last + half) % modulus - half


def within(value: FieldValue, low: float, high: float) -> bool:
    """Whether the value is finite and in [low, high]."""
    return isfinite(value) and low <= value <= high


@cache
def sensor_kinds() -> dict[str, type[Sensor]]:
    """Channel name -> its class: of drivers/sensors, or of another package, which takes the place
    of ours. Raises PluginError.
    """
    package = importlib.import_module("gritd.drivers.sensors")
    for module in pkgutil.iter_modules(package.__path__, "gritd.drivers.sensors."):
        importlib.import_module(module.name)

    kinds = [kind for base in (Sensor, Encoder, Analog) for kind in base.__subclasses__()]
    own = {
        kind.channel: kind for kind in kinds if kind.__module__.startswith("gritd.drivers.sensors.")
    }
    return own | _added(own)


def _added(own: Mapping[str, type[Sensor]]) -> dict[str, type[Sensor]]:
    """Sensor kinds of other packages, each named for a channel."""
    kinds = plugins(SENSORS, required=True)  # it stands in the place of a kind of ours
    for name, kind in kinds.items():
        if not (isinstance(kind, type) and issubclass(kind, Sensor)):
            raise refused(SENSORS, name, "found no subclass of Sensor; expected one")
        if name not in own or kind.channel != name:
            known = ", ".join(sorted(own))
            why = f"found the channel {kind.channel}; expected {name} to be one of {known}"
            raise refused(SENSORS, name, why)
    return kinds
