"""A sensor of another package: whatever it raises or returns, the others of its device go on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import FieldValue, Frame
from gritd.drivers.sensor import Sensor, SensorSettings, SignalShape
from gritd.estimator.messages.readings import ENCODERS, Value
from gritd.estimator.plugins import in_words, of_module

Result = TypeVar("Result")
COMPONENTS = 6  # of a wrench


def made(kind: type[Sensor], settings: SensorSettings) -> Sensor:
    """The sensor of a channel. Raises DeviceSettingsError."""
    named = of_module(kind.__module__)
    if not named:
        return kind(settings)  # type: ignore[arg-type]
    try:
        return Guarded(kind(settings), named)  # type: ignore[arg-type]
    except DeviceSettingsError:
        raise
    except Exception as error:
        raise DeviceSettingsError(named, in_words(error)) from None


class Guarded(Sensor):
    """A sensor that gives no more values once it has raised or returned something else than a
    value; `failed` then says so, and every further frame is quarantined.
    """

    def __init__(self, sensor: Sensor, named: str) -> None:
        super().__init__("")
        self._sensor, self._named = sensor, named
        self._unread = 0
        self.channel = sensor.channel  # type: ignore[misc]
        self.keys = tuple(map(str, sensor.keys))

    def value(self, frame: Frame) -> Value | None:
        taken = self.taken(frame, 0)
        return None if taken is None else taken[1]

    def taken(self, frame: Frame, stamp: int) -> tuple[int, Value] | None:
        taken = self._tried(lambda: self._sensor.taken(frame, stamp))
        if taken is not None and not self._fits(taken):
            self.failed = f"{self._named}: found the value {taken!r:.60}; expected {self._kind()}"
            taken = None

        self._unread += bool(self.failed)
        self.quarantined = self._sensor.quarantined + self._unread
        self.incomplete = self._sensor.incomplete
        self.turns_unknown = self._sensor.turns_unknown
        return taken

    def elapsed(self, seconds: float) -> None:
        self._tried(lambda: self._sensor.elapsed(seconds))

    def reset(self) -> None:
        self._tried(self._sensor.reset)

    def check_signals(self, signals: Sequence[SignalShape]) -> None:
        try:
            self._sensor.check_signals(signals)
        except DeviceSettingsError:
            raise
        except Exception as error:
            raise DeviceSettingsError(self._named, in_words(error)) from None

    def sent(self, value: Value) -> tuple[FieldValue, ...]:
        return self._sensor.sent(value)

    def _tried(self, call: Callable[[], Result]) -> Result | None:
        if self.failed:
            return None
        try:
            return call()
        except (Exception, SystemExit) as error:
            self.failed = f"{self._named}: {in_words(error)}"
            return None

    def _fits(self, taken: object) -> bool:
        """Whether it is a stamp and a value as the channel has them."""
        if not isinstance(taken, tuple) or len(taken) != 2 or not _is_int(taken[0]):
            return False
        value = taken[1]
        if self.channel == "wrench":
            return isinstance(value, tuple) and len(value) == COMPONENTS and all(map(_real, value))
        return _is_int(value) if self.channel in ENCODERS else _real(value)

    def _kind(self) -> str:
        if self.channel == "wrench":
            return f"{COMPONENTS} numbers"
        return "a whole number" if self.channel in ENCODERS else "a number"


def _is_int(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _real(value: object) -> bool:
    return isinstance(value, float) or _is_int(value)
