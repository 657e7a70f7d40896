"""Chunks of one device in, readings out: framing, device clock, sensors. No thread, no hardware, no
clock.
"""

from __future__ import annotations

from collections.abc import Sequence

from gritd.drivers.device_clock import DeviceClock
from gritd.drivers.framing import Frame, Framing
from gritd.drivers.sensor import Sensor
from gritd.estimator.messages.readings import NS, Reading


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
        self._clocks = {key: DeviceClock(framing.clock_modulus(key)) for key in self._listeners}
        self._last: dict[str, tuple[int, int | None]] = {}
        self._taken: dict[str, int] = {}  # when the newest frame of a key was taken [ns]

    @property
    def mistimed(self) -> int:
        """Frames whose device time cannot be right; their values are not passed on."""
        return sum(clock.rejected for clock in self._clocks.values())

    @property
    def step(self) -> tuple[int, float]:
        """How often the device's clock has stepped, and how far the last time [s]. Its keys notice
        one after the other.
        """
        steps = [(clock.steps, clock.step) for clock in self._clocks.values()]
        return max(steps, default=(0, 0.0), key=lambda of: of[0])

    def decode(self, received: int, data: bytes) -> list[Reading]:
        """The readings completed by a chunk that came at `received` [ns]. Never raises on any
        bytes.
        """
        frames = [frame for frame in self.framing.decode(data) if self._is_wanted(frame)]
        stamps = self._stamps(frames, received)

        readings = []
        for frame, stamp in zip(frames, stamps, strict=True):
            if stamp is None:  # nobody knows when it was taken
                continue
            elapsed = self._elapsed(frame.key, stamp)
            for sensor in self._listeners[frame.key]:
                sensor.elapsed(elapsed)
                if taken := sensor.taken(frame, stamp):
                    sensor.readings += 1
                    sensor.newest = taken[0]
                    readings.append(Reading(taken[0], sensor.channel, taken[1], received))

        return readings

    def restart(self) -> None:
        """The device was reopened: nothing it said before connects with what it says next."""
        self.framing.reset()
        self._last.clear()
        self._taken.clear()
        for clock in self._clocks.values():
            clock.restart()
        for sensor in self.sensors:
            sensor.reset()

    def _elapsed(self, key: str, stamp: int) -> float:
        """How long after the one before it a frame was taken [s]; 0 for the first."""
        before = self._taken.get(key, stamp)
        self._taken[key] = max(before, stamp)
        return max(stamp - before, 0) / NS

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

    def _stamps(self, frames: Sequence[Frame], received: int) -> list[int | None]:
        """When each frame's sample was taken: by the device's clock where it sends one, else the
        receive time. None where the device's time is wrong.

        Each key has a mapping of its own: its frames are in order, and wait equally long. Several
        frames of a key that came in one read are several samples, a nanosecond apart.
        """
        stamps: list[int | None] = [received] * len(frames)
        timed: dict[str, list[int]] = {}
        untimed: dict[str, list[int]] = {}

        for place, frame in enumerate(frames):
            of = untimed if frame.device_us is None else timed
            of.setdefault(frame.key, []).append(place)
        for places in untimed.values():
            for before, place in enumerate(reversed(places)):
                stamps[place] = received - before

        for key, places in timed.items():
            mapped = self._mapped(key, [frames[i].device_us or 0 for i in places], received)
            for place, stamp in zip(places, mapped, strict=True):
                stamps[place] = stamp

        return stamps

    def _mapped(self, key: str, device_us: Sequence[int], received: int) -> list[int | None]:
        """The stamps of one key's frames. Where the device started anew its counters did too: the
        sensors take a new base.
        """
        clock = self._clocks[key]
        restarts = clock.restarts
        stamps = clock.stamps(device_us, received)
        if clock.restarts != restarts:
            for sensor in self._listeners[key]:
                sensor.reset()
        return stamps
