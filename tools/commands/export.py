"""`gritd export FILE --csv|--parquet`: the topics of a recording as tables for other programs."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from gritd.estimator.config.nearest import did_you_mean
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import DAMAGED, DONE, USAGE, CommandError, Parser, os_errors
from gritd.tools.cli.optional import require
from gritd.tools.cli.progress import Progress
from gritd.tools.messages.decoders import Undecodable
from gritd.tools.recordings import tables
from gritd.tools.recordings.nested import NestedTopic

FORMS = {"csv": tables.write_csv, "parquet": tables.write_parquet}


def main(argv: Sequence[str]) -> int:
    """Exit 0; 3 where the recording is damaged, or something of it does not go into a table: then
    the tables hold what is whole, and the rest is named. Raises CommandError.
    """
    arguments = build_parser().parse_args(argv)
    if arguments.form == "parquet":
        require("pyarrow", "--parquet")

    recordings = [files.recording(part) for part in parts(arguments.file)]
    topics, left_out = _exported(recordings, _chosen(recordings, arguments.topic))
    folder = _folder(arguments)

    with os_errors(folder):
        for path in _written(recordings, topics, folder, arguments.form):
            print(path)

    for line in left_out:
        print(visible(f"gritd: {arguments.file}: left out: {line}"), file=sys.stderr)
    damage = [f"{r.path}: {visible(line)}" for r in recordings for line in r.damage]
    if damage:
        raise CommandError("; ".join(damage), DAMAGED)
    return DAMAGED if left_out else DONE


def _exported(
    recordings: Sequence[Recording], names: Sequence[str]
) -> tuple[list[tables.AnyTopic], list[str]]:
    """The topics, and a line for each that does not go into a table, or not whole."""
    topics, left_out = [], []
    with Progress("looking at topics", len(names)) as progress:
        for number, name in enumerate(names):
            progress.at(name, number / len(names))
            try:
                topics.append(tables.exported(recordings, name))
            except Undecodable as why:
                left_out.append(f"{name}: {why}")

    for topic in topics:
        left_out += topic.left_out if isinstance(topic, NestedTopic) else ()
    return topics, left_out


def _chosen(recordings: Sequence[Recording], wanted: Sequence[str]) -> list[str]:
    """The topics that are asked for, or all. Raises CommandError."""
    known = tables.exportable(recordings)
    for name in wanted:
        if name not in known:
            raise CommandError(
                f"--topic {name}: found no such topic{did_you_mean(name, known)}; "
                f"expected one of {', '.join(known)}",
                USAGE,
            )
    return [name for name in known if not wanted or name in wanted]


def _folder(arguments: Namespace) -> Path:
    """A new or empty folder for the tables. Raises CommandError."""
    folder: Path = arguments.output or arguments.file.with_suffix("")
    with os_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise CommandError(f"{folder}: holds files already; expected a new folder", USAGE)
    return folder


def _written(
    recordings: Sequence[Recording], topics: Sequence[tables.AnyTopic], folder: Path, form: str
) -> list[Path]:
    """The files, one a topic and one that says what the columns are."""
    start = tables.start_of(recordings)
    total = sum(recording.counts[topic.name] for recording in recordings for topic in topics)
    paths = []

    with Progress("exporting", total) as progress:
        for topic in topics:
            paths.append(folder / tables.file_of(topic.name, form))
            FORMS[form](paths[-1], topic, recordings, start, progress.advance)

    tables.write_columns(folder / tables.COLUMNS, topics, form)
    return [*paths, folder / tables.COLUMNS]


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd export", description="Write the topics of a recording as tables, one a topic."
    )

    parser.add_argument(
        "file", type=Path, metavar="FILE", help="recording (.mcap); its parts are found"
    )
    form = parser.add_mutually_exclusive_group(required=True)
    form.add_argument("--csv", dest="form", action="store_const", const="csv", help="CSV, UTF-8")
    form.add_argument(
        "--parquet",
        dest="form",
        action="store_const",
        const="parquet",
        help="Parquet; needs pyarrow",
    )

    parser.add_argument(
        "--topic", action="append", default=[], metavar="T", help="only this topic; may be repeated"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="new folder for the tables; default: FILE without its ending",
    )

    return parser
