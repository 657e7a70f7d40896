"""A recording as the loop saw it: tick by tick, each with the readings it consumed.

Where the recording holds ticks, file order tells which tick consumed which reading. Where it holds
raw topics only (another rig's data), ticks are built at the configured rate from the first to the
last receive time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import CHANNELS, NS, Reading
from gritd.estimator.offline.gaps import GAP, check_ticks, tick_after
from gritd.estimator.recording.salvage import Message, Recording
from gritd.estimator.recording.topics import CHECKPOINT, TICK

NEVER = -(1 << 62)  # [ns]
_RAW = {f"/raw/{channel}": channel for channel in CHANNELS}


class Checkpoint(NamedTuple):
    """What a tick began with: effective configuration and state (checkpoint.decode) as text."""

    stamp: int  # of the tick before [ns]
    configuration: str
    state: str


class RecordedTick(NamedTuple):
    """Time of a tick [ns], the readings it consumed, its logged fields and the checkpoint before
    it, if any.
    """

    stamp: int
    readings: list[Reading]
    logged: tuple[Any, ...] | None
    checkpoint: Checkpoint | None = None


def recorded_ticks(recording: Recording, rate: float) -> Iterator[RecordedTick]:
    """The ticks of a recording; `rate` [Hz] is used where it has none of its own."""
    return (
        _logged(recording)
        if recording.counts[TICK]
        else ticks_at(_in_order(recording.messages()), rate)
    )


def reading_of(message: Message) -> Reading | None:
    """The reading in a raw message; None for every other topic."""
    topic, received, values = message
    channel = _RAW.get(topic)
    if channel is None:
        return None
    return Reading(
        values[0], channel, values[1] if len(values) == 2 else tuple(values[1:]), received
    )


def _logged(recording: Recording) -> Iterator[RecordedTick]:
    waiting: list[Reading] = []
    checkpoint = None
    for message in recording.messages():
        if message[0] == TICK:
            yield RecordedTick(message[2][0], waiting, message[2], checkpoint)
            waiting, checkpoint = [], None
        elif message[0] == CHECKPOINT:
            waiting, checkpoint = [], Checkpoint(*message[2])
        elif (reading := reading_of(message)) is not None:
            waiting.append(reading)


def ticks_at(readings: Iterable[Reading], rate: float) -> Iterator[RecordedTick]:
    """Ticks at `rate` [Hz] over readings in the order they were received, from the first to the
    last, but for gaps (`gaps.built_ticks`). Raises RecordingError where there are too many.
    """
    period, waiting, count = round(NS / rate), list[Reading](), 0
    start = stamp = heard = NEVER
    for reading in readings:
        now = reading.received
        if start == NEVER:
            start = stamp = heard = now

        while now > stamp:
            yield RecordedTick(stamp, waiting, None)
            waiting, count = [], count + 1
            check_ticks(count)
            over = now - heard > GAP and stamp >= heard + GAP
            stamp = tick_after(start, period, now) if over else stamp + period

        heard = max(heard, now)
        waiting.append(reading)

    if start != NEVER:
        yield RecordedTick(stamp, waiting, None)


def _in_order(messages: Iterable[Message]) -> list[Reading]:
    readings = [reading for reading in map(reading_of, messages) if reading is not None]
    return sorted(readings, key=lambda reading: reading.received)


def without_absent(settings: Settings, recording: Recording) -> Settings:
    """The settings without a force/torque sensor that the recording does not hold."""
    absent = settings.wrench is not None and not recording.counts["/raw/wrench"]
    return replace(settings, wrench=None) if absent else settings
