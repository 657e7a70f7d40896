"""Any table of time series, with a map that says which column is which channel."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.plausibility.words import sentences
from gritd.tools.cli import configuration_file
from gritd.tools.cli.command import USAGE
from gritd.tools.cli.progress import Progress
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.recording import write
from gritd.tools.importers.registry import Tell
from gritd.tools.importers.segments import START
from gritd.tools.importers.series import written
from gritd.tools.importers.series.clocks import runs_of
from gritd.tools.importers.series.columns import Advance, SeriesTable, Wanted
from gritd.tools.importers.series.convert import AXES, converted
from gritd.tools.importers.series.encoders import SPEEDS
from gritd.tools.importers.series.guess import guessed
from gritd.tools.importers.series.mapping import AS_CONFIGURED, SeriesMap, load
from gritd.tools.importers.series.plausible import driven_of, sources_of
from gritd.tools.importers.series.runs import SeriesRun, check
from gritd.tools.importers.series.sources import RunFiles, read, runs_files, series_files

NAME = "series"
ALIASES = ("csv",)
SUMMARY = "time series of any rig, tables, bags and logs, by a map of columns to channels"

ENOUGH = 20_000  # rows of each table of a bag that a proposal is made from


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The map, or a proposal for one; the testbed."""
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--map", type=Path, metavar="MAP.yaml", help="which column is which")
    which.add_argument(
        "--guess", action="store_true", help="print a proposal for the map, and import nothing"
    )
    parser.add_argument(
        "--config", type=Path, metavar="F", help="the testbed: wheel, soil, drive; else the map's"
    )


def run(args: argparse.Namespace, tell: Tell) -> list[Path]:
    """One recording a run, one configuration. Raises RigFileError, ConfigError, RecordingError."""
    if args.guess:
        left_out: list[str] = []
        text = guessed(_all(args.paths, left_out))
        tell("\n".join([*(f"# {line}" for line in left_out), text.rstrip("\n")]))
        return []
    if args.map is None:
        raise RigFileError("expected --map MAP.yaml, or --guess to propose one", USAGE)
    if args.output is None:
        raise RigFileError("expected -o OUTDIR", USAGE)

    mapped = load(args.map)
    left_out = []
    runs = _read(runs_files(args.paths, mapped, left_out), mapped)
    for line in left_out:
        tell(f"note: {line}")
    return _import(runs, mapped, args.config, args.output, tell)


def _all(paths: Sequence[Path], left_out: list[str]) -> list[SeriesTable]:
    """Every table of the files. Raises RigFileError."""
    files = series_files(paths, left_out)
    tables: list[SeriesTable] = []
    with Progress("reading") as progress:
        for path, advance in zip(files, _shares(progress, files), strict=True):
            tables += read(path, Wanted(rows=ENOUGH), advance=advance)
    return tables


def _read(files: Sequence[RunFiles], mapped: SeriesMap) -> list[SeriesRun]:
    """The runs of all files. Raises RigFileError."""
    runs: list[SeriesRun] = []
    paths = [path for each in files for _, path in each.files]
    with Progress("reading") as progress:
        shares = _shares(progress, paths)
        for each in files:
            runs += runs_of(each, mapped, [next(shares) for _ in each.files])
    check(runs, mapped)
    return runs


def _shares(progress: Progress, paths: Sequence[Path]) -> Iterator[Advance]:
    """For each file what takes the bytes of it that were read."""
    sizes = [path.stat().st_size + 1 if path.is_file() else 1 for path in paths]
    for at, path in enumerate(paths):
        before = sum(sizes[:at])
        progress.at(path.name, before / sum(sizes))

        def advance(done: int, name: str = path.name, before: int = before) -> None:
            progress.at(name, (before + done) / sum(sizes))

        yield advance


def _import(
    runs: Sequence[SeriesRun],
    mapped: SeriesMap,
    given: Path | None,
    output: Path,
    tell: Tell,
) -> list[Path]:
    """Write the configuration, then a recording a run."""
    interval = max(run.interval for run in runs)
    text, configured = written.base(mapped, given)
    speeds = any(mapped.named(channel) for channel in SPEEDS)
    text = written.slow(text, configured, interval, speeds)
    folder = given.resolve().parent if given else None
    settings = config.loads(text, configured.source, folder).settings

    imported = converted(runs, mapped, settings, START)
    text = written.written(text, configured.source, imported)
    configured = _configuration(text, given, output / "csv.yaml")

    paths = [output / "csv.yaml"]
    count = sum(stream.stamps.size for streams in imported.streams for stream in streams)
    with Progress("writing readings", count) as progress:
        for run, streams in zip(runs, imported.streams, strict=True):
            path = output / f"{run.info.name}.mcap"
            paths.append(write(path, streams, configured, run.info, progress))

    behind = runs[0].resampled
    tell("every row is a reading" if behind == 1.0 else f"means over {behind:.1f} rows")
    driven = driven_of(runs, imported.streams, configured.settings)
    for line in (
        *sentences(driven, sources_of(mapped)),
        *_notes(mapped, runs, settings, given),
    ):
        tell(line)
    return paths


def _configuration(text: str, given: Path | None, path: Path) -> config.Configuration:
    """Write the configuration beside the recordings. Raises RigFileError, ConfigError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigFileError(
            f"{path.parent}: cannot be made: {error.strerror}; expected a folder", USAGE
        ) from None
    configuration_file.save(text, given or path.with_name("rig_csv.yaml"), path)
    return config.load(path)


# --- what is reported ---


def _notes(
    mapped: SeriesMap, runs: Sequence[SeriesRun], settings: Settings, given: Path | None
) -> list[str]:
    """What the user should know of what was not given."""
    left_out = (line for run in runs for line in (*run.table.notes, *run.notes))
    notes = [f"note: {line}" for line in dict.fromkeys(left_out)]
    notes += [
        f"note: {run.info.name}: {run.repeated} rows that repeat the row before are left out"
        for run in runs
        if run.repeated
    ]

    notes += _unstated(mapped, given)
    if mapped.drive_alone:
        alone = "gritd calibrate torque and gritd diagnose read it, no soil can be estimated"
        return [*notes, f"note: a drive without a carriage: {alone}"]

    unstated = [run.info.name for run in runs if run.info.nominal_load is None]
    if unstated and mapped.named("load") is None:
        notes.append(
            f"note: {unstated[0]} states no load; taken is {settings.load.nominal.value:g} N, "
            "load.nominal of csv.yaml"
        )

    if not any(mapped.named(axis) for axis in AXES):
        notes.append("note: no force is measured; only the torque can tell of the soil")
    return notes


def _unstated(mapped: SeriesMap, given: Path | None) -> list[str]:
    """Calibrations of the template that stand for nobody's."""
    if given is not None:
        return []
    notes = [
        f"note: {name}: {channel} is scaled as in the template, which knows nothing; give --config"
        for channel in AS_CONFIGURED
        if (name := mapped.named(channel)) is not None
    ]
    current = mapped.named("current")
    if current is not None and mapped.torque_constant is None:
        notes.append(f"note: {current}: no torque_constant is stated; taken is 1 N*m/A")
    return notes
