"""`gritd replay`: the on-line filter over recordings, to check them or to recompute them."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gritd.estimator.config.configuration import Configuration, load, loads
from gritd.estimator.config.settings import ENGINES, Settings, settings_of_run
from gritd.estimator.messages.status import Status
from gritd.estimator.messages.tick import TICK_FIELDS, TICK_NAMES, TickRow
from gritd.estimator.offline.batch import estimates
from gritd.estimator.offline.playback import RecordedTick, recorded_ticks, without_absent
from gritd.estimator.offline.rerun import Rerun
from gritd.estimator.recording.cdr import TIME
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.recording.topics import TICK_TOPIC, TOPICS
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import DAMAGED, DONE, FAILED, USAGE, CommandError, Parser
from gritd.tools.cli.progress import Progress
from gritd.tools.commands.readiness import never_ready
from gritd.tools.commands.replay_report import Rows, report

SHOWN = 5  # differing fields named in full


def main(argv: Sequence[str]) -> int:
    """Exit 0; 1 if a verified replay differs; 2 for usage and configuration; 3 if a recording is
    damaged.
    """
    arguments = _parser().parse_args(argv)
    if arguments.verify and (arguments.config or arguments.output or arguments.engine):
        raise CommandError(
            "--verify replays a recording as it was made: without --config, --engine, --output",
            USAGE,
        )

    paths = [Path(name) for name in arguments.files]

    for path in paths:
        if not path.exists():
            raise CommandError(f"{path}: found no such file; expected a recording", USAGE)
        if arguments.output:
            files.vacant(_target(arguments, path))

    return max([_replay(path, arguments) for path in paths])


def _replay(path: Path, arguments: Namespace) -> int:
    recordings = [files.recording(part) for part in parts(path)]

    for recording in recordings:
        for line in recording.damage or (
            [] if recording.closed else ["was not closed: replayed as far as it goes"]
        ):
            print(visible(f"{recording.path}: {line}"), file=sys.stderr)

    damaged = any(recording.damage for recording in recordings)
    configuration = _configuration(recordings[0], arguments.config)

    if arguments.verify:
        return max(_verify(recordings, configuration), DAMAGED if damaged else DONE)

    try:
        _recompute(recordings, configuration, arguments)
    except RecordingError as error:
        raise (
            CommandError(error, DAMAGED) if error.errno is None else files.unwritten(error)
        ) from None

    return DAMAGED if damaged else DONE


def _configuration(recording: Recording, path: str | None) -> Configuration:
    """The given configuration, or the one the recording was made with."""
    if path is not None:
        return load(path)
    if recording.config_yaml is None:
        raise CommandError(
            f"{recording.path}: holds no configuration; give one with --config", USAGE
        )
    return loads(recording.config_yaml, f"{recording.path}: gritd.config")


# --- verification ---


def _verify(recordings: list[Recording], configuration: Configuration) -> int:
    """Recompute every tick and compare it, bit for bit, with the logged one."""
    first = recordings[0]
    if not first.counts["/tick"]:
        raise CommandError(f"{first.path}: holds no /tick to verify against", USAGE)
    if first.topics["/tick"].names != TICK_TOPIC.names:
        version = first.versions.get("gritd", "another version")
        raise CommandError(
            f"{first.path}: its /tick was written by gritd {version} and has other fields", USAGE
        )

    rerun = _rerun(recordings, configuration, None, as_it_ran=True)
    if first.run.part:
        rerun.lose()

    differing = Differences()

    for recording, tick in _ticks(recordings, configuration, "verifying"):
        if recording.run.lost_before and recording is not differing.recording:
            rerun.lose()
        differing.recording = recording
        if tick.checkpoint is not None:
            differing.resumed(tick.stamp, rerun.resume(tick.checkpoint))

        record = rerun.step(tick)
        if tick.logged is not None and rerun.known:
            differing.compare(tick.logged, record)
        elif tick.logged is not None:
            differing.unknown += 1

    print(f"{first.path}: {differing.compared} ticks, {len(TICK_NAMES)} fields each: {differing}")

    if not differing.compared:
        raise CommandError(
            f"{first.path}: its first state is not known; verify from the run's first part", USAGE
        )
    return FAILED if differing.ticks else DONE


@dataclass
class Differences:
    """Fields of /tick that a replay did not reproduce."""

    ticks: int = 0
    compared: int = 0
    unknown: int = 0  # after a loss, before the next checkpoint
    recording: Recording | None = None  # the last part looked at
    lines: list[str] = field(default_factory=list)

    def resumed(self, stamp: int, same: bool) -> None:
        """A checkpoint was met from the ticks before it."""
        if not same:
            self.ticks += 1
            self.lines.append(
                f"checkpoint before the tick at {stamp}: "
                "not the state that the ticks before it lead to"
            )

    def compare(self, logged: TickRow, computed: TickRow) -> None:
        self.compared += 1
        encode = TICK_TOPIC.codec.encode
        if encode(logged) == encode(computed):
            return
        self.ticks += 1
        for name, was, now in zip(TICK_NAMES, logged, computed, strict=True):
            if repr(was) != repr(now) and float(was) != float(now) and len(self.lines) < SHOWN:
                self.lines.append(f"tick {self.compared}: {name}: logged {was!r}, replayed {now!r}")

    def __str__(self) -> str:
        if not self.ticks:
            after = (
                f"; {self.unknown} more after lost messages not comparable" if self.unknown else ""
            )
            return f"identical bit for bit{after}"
        return "\n  ".join([f"{self.ticks} ticks differ", *self.lines])


# --- recomputation ---


def _recompute(
    recordings: list[Recording], configuration: Configuration, arguments: Namespace
) -> None:
    """Print what the filter makes of the recording; window by window, unless every tick is asked
    for.
    """
    first = recordings[0]
    reloaded = first.counts["/checkpoint"] > 1 and not arguments.config

    if arguments.output or len(recordings) > 1 or reloaded:
        rows, each = _every_tick(recordings, configuration, arguments), "ticks"
    else:
        settings = _told(first, configuration, first)
        rows, each = (
            estimates(settings, first, arguments.engine or settings.filter.engine),
            "windows",
        )

    if not len(rows):
        raise CommandError(f"{first.path}: holds no readings", DAMAGED)

    print(report(first.path, rows, each))
    if np.all(rows["status"] == Status.STARTING):
        print(
            f"{first.path}: {never_ready(_settings(first, configuration, first), first)}",
            file=sys.stderr,
        )


def _every_tick(
    recordings: list[Recording], configuration: Configuration, arguments: Namespace
) -> Rows:
    first = recordings[0]
    output = files.vacant(_target(arguments, first.path)) if arguments.output else None
    writer = RunWriter(output, TOPICS, configuration.text, first.run) if output else None

    records = []
    rerun = _rerun(recordings, configuration, arguments.engine, as_it_ran=False)

    for _, tick in _ticks(recordings, configuration, "replaying"):
        if tick.checkpoint is not None and not arguments.config:
            rerun.reconfigure(tick.checkpoint)
        record = rerun.step(tick)
        records.append(record)
        if writer is not None:
            for reading in tick.readings:
                writer.reading(reading)
            writer.message(TICK_TOPIC.name, tick.stamp, record)

    if writer is not None:
        writer.close()
        print(f"wrote {writer.path}")

    return np.array(
        records, dtype=[(name, "<i8" if kind == TIME else "<f8") for name, kind, _ in TICK_FIELDS]
    )


def _target(arguments: Namespace, path: Path) -> Path:
    """The output file; a folder where there are several recordings."""
    output = Path(arguments.output)
    if len(arguments.files) > 1 and not output.is_dir():
        raise CommandError(f"{output}: several recordings need a folder to be written to", USAGE)
    return output / path.name if output.is_dir() else output


def _rerun(
    recordings: list[Recording], configuration: Configuration, engine: str | None, as_it_ran: bool
) -> Rerun:
    """as_it_ran: the recording's own ticks again; a force/torque sensor that never spoke was
    silent, not absent.
    """
    first = recordings[0]
    recorded = first if not as_it_ran or not first.counts["/tick"] else None
    _told(first, configuration, recorded)
    return Rerun(configuration, lambda given: _settings(first, given, recorded), engine)


def _told(first: Recording, configuration: Configuration, recorded: Recording | None) -> Settings:
    """The settings of a run; says so where they do without a configured sensor."""
    settings = _settings(first, configuration, recorded)
    if settings.wrench is None and configuration.settings.wrench is not None:
        print(f"{first.path}: no /raw/wrench: replayed with the configured load", file=sys.stderr)
    return settings


def _settings(first: Recording, given: Configuration, recorded: Recording | None) -> Settings:
    """Settings of the run, without the sensors that `recorded` does not hold."""
    return settings_of_run(
        without_absent(given.settings, recorded) if recorded else given.settings, first.run
    )


def _ticks(
    recordings: list[Recording], configuration: Configuration, what: str
) -> Iterator[tuple[Recording, RecordedTick]]:
    """Every tick of a run, its parts one after the other."""
    total = sum(recording.counts["/tick"] for recording in recordings)
    with Progress(f"{what} {recordings[0].path.name}", total) as progress:
        for recording in recordings:
            for tick in recorded_ticks(recording, configuration.settings.rates.tick):
                progress.advance()
                yield recording, tick


def _parser() -> Parser:
    parser = Parser(prog="gritd replay", description="Run the on-line filter over recordings.")
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="recordings (.mcap); parts of a run are found"
    )
    parser.add_argument(
        "--config",
        metavar="F",
        help="recompute with this configuration instead of the recorded one",
    )
    parser.add_argument(
        "--verify", action="store_true", help="compare every field of every /tick, bit for bit"
    )
    parser.add_argument("--engine", choices=ENGINES, help="instead of the configured filter engine")
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="write readings and recomputed ticks to a recording"
    )

    return parser
