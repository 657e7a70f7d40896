"""The force/torque sensor between wheel and carriage."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import Frame
from gritd.drivers.sensor import Sensor, SignalShape, within
from gritd.estimator.config.settings import Wrench as WrenchSettings
from gritd.estimator.messages.readings import WRENCH_FIELDS, Value

FORCES = 3  # fx fy fz come before tx ty tz


class WrenchSensor(Sensor):
    """fx fy fz [N], tx ty tz [N·m], from one frame or from several of the same cycle.

    `signal` names the frames, joined by `+`, in the order in which their values make up the six.
    Frames belong together if they carry the same sequence number, whatever their order; a cycle
    with a missing frame is dropped and counted. It was taken when the frame with the device's time
    says, if one of them has it, else when the last of them came.
    """

    channel = "wrench"

    def __init__(self, settings: WrenchSettings) -> None:
        super().__init__(settings.signal)
        self.keys = tuple(settings.signal.split("+"))
        self._limits = (settings.max_force,) * FORCES + (settings.max_torque,) * FORCES
        self._parts: dict[str, Frame] = {}
        self._cycle: int | None = None
        self._stamp: int | None = None  # of this cycle, by the device's time [ns]

    def taken(self, frame: Frame, stamp: int) -> tuple[int, Value] | None:
        if frame.sequence != self._cycle:
            self._stamp = None
        if frame.device_us is not None:
            self._stamp = stamp
        value = self.value(frame)
        return None if value is None else (self._stamp if self._stamp is not None else stamp, value)

    def value(self, frame: Frame) -> tuple[float, ...] | None:
        if frame.sequence != self._cycle or frame.key in self._parts:
            self.incomplete += bool(self._parts)
            self._parts = {}
        self._cycle = frame.sequence
        self._parts[frame.key] = frame
        if len(self._parts) < len(self.keys):
            return None
        values = [value for key in self.keys for value in self._parts[key].values]
        self._parts = {}
        return self._checked(values)

    def _checked(self, values: list[int | float]) -> tuple[float, ...] | None:
        limits = self._limits
        if len(values) != len(limits) or not all(
            within(v, -m, m) for v, m in zip(values, limits, strict=True)
        ):
            self.refuse()
            return None
        return tuple(map(float, values))

    def reset(self) -> None:
        self._parts = {}
        self._cycle = self._stamp = None

    def check_signals(self, signals: Sequence[SignalShape]) -> None:
        names = [signal.name.rpartition(".")[2].lower() for signal in signals]
        if names != list(WRENCH_FIELDS):
            reason = f"its signals are {' '.join(names)}, expected {' '.join(WRENCH_FIELDS)}"
            raise DeviceSettingsError("wrench", reason)
