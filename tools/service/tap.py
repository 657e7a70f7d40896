"""The raw bytes of every device: kept while the daemon runs, played through the drivers again."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from gritd.drivers.build import build_decoder, used_devices
from gritd.drivers.decoder import Decoder
from gritd.drivers.link import Chunk, Clock
from gritd.drivers.recorded import Playback, decoded
from gritd.drivers.wire_log import WireWriter, read_wire, wire_path
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.daemon.daemon import MODES
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.playback import ticks_at
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.topics import TOPICS, messages_of
from gritd.tools.cli.command import DAMAGED, CommandError, os_errors
from gritd.tools.cli.progress import Progress

# [ns] a recording keeps seconds as int32, and a stamp may lie before its bytes
EARLIEST, LATEST = 31_536_000 * 10**9, (2**31 - 86_400) * 10**9


class Taps:
    """A wire log for every device, in a folder that is made where there is none.

    Raises CommandError where the folder cannot be made or holds logs already.
    """

    def __init__(self, folder: Path, settings: Settings) -> None:
        self._reported: set[Path] = set()
        with os_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)

        mode = MODES[settings.logging.readable_by]
        self.writers = {
            device.name: WireWriter(wire_path(folder, device.name), mode)
            for device in used_devices(settings)
        }

    def trouble(self) -> list[str]:
        """What is to be reported since the last call, one line each: logs that were given up."""
        failed = [w for w in self.writers.values() if w.error and w.path not in self._reported]
        self._reported |= {writer.path for writer in failed}
        return [f"{writer.path}: {writer.error}; nothing more is kept of it" for writer in failed]

    def close(self) -> str:
        """End the logs; a line that says what they hold."""
        for writer in self.writers.values():
            writer.close()
        kept = (f"{writer.path} {writer.bytes} bytes" for writer in self.writers.values())
        return f"tap: {', '.join(kept)}"


def playback_of(folder: Path, settings: Settings, clock: Clock) -> Playback:
    """The wire logs of a folder, one for each device that some channel uses."""
    return Playback(_wires(folder, settings), clock)


def play_at_once(configuration: Configuration, folder: Path, run: RunInfo, output: Path) -> str:
    """Play wire logs as fast as possible, with the times they were recorded at: readings and ticks
    into a recording. A line that says what was played.

    Ticks are made at the configured rate, so the same logs give the same recording. Raises
    DeviceSettingsError and RecordingError, CommandError where the logs hold no reading.
    """
    settings = settings_of_run(configuration.settings, run)
    wires = _wires(folder, settings)
    decoders = {device.name: build_decoder(settings, device) for device in used_devices(settings)}

    with Progress(f"playing {folder}", _bytes(wires)) as progress:
        readings = _merged(wires, decoders, progress)
        first = next(readings, None)
        if first is None:
            raise CommandError(f"{folder}: the wire logs hold no readings", DAMAGED)
        counts = _record(configuration, settings, run, chain((first,), readings), output)

    return f"played {folder}: {counts.readings} readings, {counts.ticks} ticks; {_damage(decoders)}"


class RecordedCounts(NamedTuple):
    """What came into a recording."""

    readings: int
    ticks: int


def _record(
    configuration: Configuration,
    settings: Settings,
    run: RunInfo,
    readings: Iterable[Reading],
    output: Path,
) -> RecordedCounts:
    """Readings and the ticks they make, in the order in which the loop hands them over."""
    pipeline = Pipeline(settings)
    state, taken, ticks = pipeline.start(), 0, 0
    writer = RunWriter(
        output,
        TOPICS,
        configuration.text,
        run,
        compression=settings.logging.compression,
        mode=MODES[settings.logging.readable_by],
    )

    for tick in ticks_at(readings, settings.rates.tick):
        for reading in tick.readings:
            writer.reading(reading)
        state, row = pipeline.step(state, tick.readings, tick.stamp)
        for message in messages_of(row):
            writer.message(*message)
        taken, ticks = taken + len(tick.readings), ticks + 1

    writer.close()
    return RecordedCounts(taken, ticks)


def _wires(folder: Path, settings: Settings) -> dict[str, Path]:
    return {device.name: wire_path(folder, device.name) for device in used_devices(settings)}


def _bytes(wires: dict[str, Path]) -> int:
    return sum(path.stat().st_size for path in wires.values() if path.is_file())


def _merged(
    wires: dict[str, Path], decoders: dict[str, Decoder], progress: Progress
) -> Iterator[Reading]:
    """The readings of all devices in the order they were received."""

    def counted(path: Path) -> Iterator[Chunk]:
        for chunk in read_wire(path):
            if not EARLIEST <= chunk.received < LATEST:
                found = f"bytes received at {chunk.received} ns"
                raise CommandError(f"{path}: found {found}; expected from 1971 to 2038", DAMAGED)
            progress.advance(len(chunk.data))
            yield chunk

    streams = [decoded(counted(path), decoders[name]) for name, path in wires.items()]
    return heapq.merge(*streams, key=lambda reading: reading.received)


def _damage(decoders: dict[str, Decoder]) -> str:
    counts = {name: decoder.framing.counts for name, decoder in decoders.items()}
    return ", ".join(
        f"{name} {c.good} frames, {c.bad} bad, {c.lost} lost" for name, c in counts.items()
    )
