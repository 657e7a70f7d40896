"""`gritd replay`: the on-line filter over recordings, to check them or to recompute them."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from gritd.estimator.config.configuration import Configuration, load, loads, with_engine
from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.reasons import Reason
from gritd.estimator.messages.status import Status
from gritd.estimator.messages.tick import TICK_FIELDS
from gritd.estimator.offline.batch import replayed
from gritd.estimator.offline.bed_runs import bed_runs
from gritd.estimator.offline.playback import Checkpoint
from gritd.estimator.offline.streams import STREAMS
from gritd.estimator.recording.cdr import TIME
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.recording.tables import NOTHING
from gritd.estimator.recording.topics import CHECKPOINT, TOPICS, messages_of
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import (
    DAMAGED,
    DONE,
    USAGE,
    CommandError,
    Parser,
    add_configuration,
    whole,
)
from gritd.tools.cli.progress import Progress
from gritd.tools.commands import replay_jobs
from gritd.tools.commands.estimate import check_same_rig, lines
from gritd.tools.commands.readiness import never_ready
from gritd.tools.commands.replay_report import Rows, report
from gritd.tools.commands.replay_run import announced_settings, rerun_of, run_settings, ticks_of
from gritd.tools.commands.replay_verify import verify
from gritd.tools.recordings.provenance import check_rig

AT_ONCE = 10_000  # ticks; as Python's numbers they take several times their place in an array
ROW = np.dtype([(name, "<i8" if kind == TIME else "<f8") for name, kind, _ in TICK_FIELDS])


def main(argv: Sequence[str]) -> int:
    """Exit 0; 1 if a verified replay differs; 2 for usage and configuration; 3 if a recording is
    damaged.
    """
    arguments = build_parser().parse_args(argv)
    if arguments.carry and (arguments.verify or arguments.output):
        raise CommandError("--carry: expected neither --verify nor --output with it", USAGE)
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

    if arguments.carry:
        return _carried(paths, arguments)
    if arguments.jobs > 1 and len(paths) > 1:
        return replay_jobs.each(paths, partial(_replay, arguments=arguments), arguments.jobs)
    return max([_replay(path, arguments) for path in paths])


def _carried(paths: Sequence[Path], arguments: Namespace) -> int:
    """Every run begun with what the runs before it know, as the daemon does on one bed."""
    recordings = [files.recording(path, STREAMS) for path in paths]
    configurations = [_configuration(recording, arguments) for recording in recordings]
    given = [run_settings(r, c, r) for r, c in zip(recordings, configurations, strict=True)]
    check_same_rig(given, recordings)

    repeatability = configurations[0].settings.bed.repeatability
    engine = configurations[0].settings.filter.engine
    runs = []
    with Progress("replaying") as progress:
        each = bed_runs(
            zip(given, recordings, strict=True), repeatability, engine, progress.reached
        )
        try:
            for run in each:
                runs.append(run)
                carried = run.carried
                print(report(run.recording.path, carried.rows, "windows", carried.reason))
        except RecordingError as error:
            raise CommandError(error, DAMAGED) from None

    print("\n".join(["", *lines(runs, repeatability)]))
    return DAMAGED if any(recording.damage for recording in recordings) else DONE


def _replay(path: Path, arguments: Namespace) -> int:
    each = arguments.verify or arguments.output  # tick by tick, not from tables
    tables = NOTHING if each else STREAMS
    recordings = [files.recording(part, tables) for part in parts(path)]

    for recording in recordings:
        for line in recording.damage or (
            [] if recording.closed else ["was not closed: replayed as far as it goes"]
        ):
            print(visible(f"{recording.path}: {line}"), file=sys.stderr)

    damaged = any(recording.damage for recording in recordings)
    configuration = _configuration(recordings[0], arguments)
    if arguments.config and not arguments.other_rig:
        check_rig(recordings, configuration.settings, arguments.config)

    if arguments.verify:
        return max(verify(recordings, configuration), DAMAGED if damaged else DONE)

    try:
        _recompute(recordings, configuration, arguments)
    except RecordingError as error:
        raise (
            CommandError(error, DAMAGED) if error.errno is None else files.unwritten(error)
        ) from None

    return DAMAGED if damaged else DONE


def _configuration(recording: Recording, arguments: Namespace) -> Configuration:
    """The given configuration, or the one the recording was made with, with the engine that is
    asked for.
    """
    if arguments.config is not None:
        return with_engine(load(arguments.config), arguments.engine)

    if recording.config_yaml is None:
        raise CommandError(
            f"{recording.path}: holds no configuration; give one with --config", USAGE
        )

    recorded = loads(recording.config_yaml, f"{recording.path}: gritd.config")
    return with_engine(recorded, arguments.engine)


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
        rows, each, reason = _every_tick(recordings, configuration, arguments), "ticks", Reason()
    else:
        settings = announced_settings(first, configuration, first)
        with Progress(f"replaying {first.path.name}") as progress:
            made = replayed(settings, first, settings.filter.engine, advance=progress.reached)
        rows, each, reason = made.rows, "windows", made.reason

    if not len(rows):
        raise CommandError(f"{first.path}: holds no readings", DAMAGED)

    print(report(first.path, rows, each, reason))
    if np.all(rows["status"] == Status.STARTING):
        print(
            f"{first.path}: {never_ready(run_settings(first, configuration, first), first)}",
            file=sys.stderr,
        )


def _every_tick(
    recordings: list[Recording], configuration: Configuration, arguments: Namespace
) -> Rows:
    first = recordings[0]
    output = files.vacant(_target(arguments, first.path)) if arguments.output else None
    run = replace(first.run, bed="")  # it begins with the stated prior
    writer = RunWriter(output, TOPICS, configuration.text, run) if output else None

    records, tables = [], [np.empty(0, ROW)]
    rerun = rerun_of(recordings, configuration, as_it_ran=False)

    for _, tick in ticks_of(recordings, configuration, "replaying"):
        if tick.checkpoint is not None and not arguments.config:
            stamp = tick.checkpoint.stamp
            changed = rerun.reconfigure(_with_engine(tick.checkpoint, arguments.engine))
            if changed and writer is not None:
                writer.message(CHECKPOINT, stamp, rerun.checkpoint(stamp))
        record = rerun.step(tick)
        records.append(record)
        if len(records) == AT_ONCE:
            tables.append(np.array(records, ROW))
            records = []
        if writer is not None:
            for reading in tick.readings:
                writer.reading(reading)
            for message in messages_of(record):
                writer.message(*message)

    if writer is not None:
        writer.close()
        print(f"wrote {writer.path}")

    return np.concatenate([*tables, np.array(records, ROW)])


def _with_engine(checkpoint: Checkpoint, engine: str | None) -> Checkpoint:
    """The checkpoint as a run with this engine would have logged it."""
    if engine is None:
        return checkpoint
    configuration = with_engine(loads(checkpoint.configuration, CHECKPOINT), engine)
    return checkpoint._replace(configuration=configuration.text)


def _target(arguments: Namespace, path: Path) -> Path:
    """The output file; a folder where there are several recordings."""
    output = Path(arguments.output)
    if len(arguments.files) > 1 and not output.is_dir():
        raise CommandError(f"{output}: several recordings need a folder to be written to", USAGE)
    return output / path.name if output.is_dir() else output


def build_parser() -> Parser:
    parser = Parser(prog="gritd replay", description="Run the on-line filter over recordings.")
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="recordings (.mcap); parts of a run are found"
    )
    add_configuration(parser, "recompute with this configuration instead of the recorded one")
    parser.add_argument(
        "--verify", action="store_true", help="compare every field of every /tick, bit for bit"
    )
    parser.add_argument(
        "--carry",
        action="store_true",
        help="the recordings are runs on one bed: each begins with what those before it know",
    )
    parser.add_argument("--engine", choices=ENGINES, help="instead of the configured filter engine")
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="write readings and recomputed ticks to a recording"
    )
    parser.add_argument(
        "--jobs",
        type=whole(1, 1024),
        default=os.cpu_count() or 1,
        metavar="J",
        help="recordings at once, each in a process; default: one a core; --carry takes one",
    )

    return parser
