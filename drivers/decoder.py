"""Chunks of one device in, readings out: framing, device clock, sensors. No thread, no hardware, no
clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from gritd.drivers.device_clock import DeviceClock
from gritd.drivers.framing import Frame, Framing
from gritd.drivers.sensor import Sensor
from gritd.estimator.messages.readings import Reading


class Decoder:
    """The same path for a live device and a recorded one."""

    def __init__(self, framing: Framing, sensors: Sequence[Sensor]) -> None:
        self.framing = framing
        self.sensors = tuple(sensors)
        self.duplicates = 0  # frames that came twice in a row, dropped
        self.unknown = 0  # good frames whose key no channel wants
        self._listeners = {
            key: [s for s in sensors if key in s.keys] for s in sensors for key in s.keys
        }
        self._clocks: dict[str, DeviceClock] = {}
        self._last: dict[str, tuple[int, int | None]] = {}

    def decode(self, received: int, data: bytes) -> list[Reading]:
        """The readings completed by a chunk that came at `received` [ns]. Never raises on any
        bytes.
        """
        frames = [frame for frame in self.framing.decode(data) if self._is_wanted(frame)]
        stamps = self._stamps(frames, received)
        readings = []
        for frame, stamp in zip(frames, stamps, strict=True):
            for sensor in self._listeners[frame.key]:
                value = sensor.value(frame)
                if value is not None:
                    readings.append(Reading(stamp, sensor.channel, value, received))
        return readings

    def restart(self) -> None:
        """The device was reopened: nothing it said before connects with what it says next."""
        self.framing.reset()
        self._last.clear()
        for clock in self._clocks.values():
            clock.restart()
        for sensor in self.sensors:
            sensor.reset()

    def _is_wanted(self, frame: Frame) -> bool:
        if frame.key not in self._listeners:
            self.unknown += 1
            return False
        if frame.sequence is None:
            return True
        seen = (frame.sequence, frame.device_us)
        twice = self._last.get(frame.key) == seen
        self._last[frame.key] = seen
        self.duplicates += twice
        return not twice

    def _stamps(self, frames: Sequence[Frame], received: int) -> list[int]:
        """When each frame's sample was taken: by the device's clock where it sends one, else the
        receive time.
        """
        stamps = [received] * len(frames)
        timed = [
            (self.framing.clock(f.key), i) for i, f in enumerate(frames) if f.device_us is not None
        ]
        for (name, modulus), group in groupby(sorted(timed), key=lambda item: item[0]):
            indices = [i for _, i in group]
            clock = self._clocks.setdefault(name, DeviceClock(modulus))
            resets = clock.resets
            times = clock.stamps([frames[i].device_us or 0 for i in indices], received)
            for i, time in zip(indices, times, strict=True):
                stamps[i] = time
            if clock.resets != resets:
                self._device_started_anew(name)
        return stamps

    def _device_started_anew(self, clock: str) -> None:
        """Its counters began again: the sensors behind this clock take a new base."""
        for key, sensors in self._listeners.items():
            if self.framing.clock(key)[0] == clock:
                for sensor in sensors:
                    sensor.reset()
