"""`gritd bed`: the bed in the bin, on which the runs of the daemon add up."""

from __future__ import annotations

import time
from argparse import SUPPRESS, ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from math import sqrt
from pathlib import Path

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.daemon import bed_file
from gritd.estimator.daemon.bed_file import Bed, BedError
from gritd.estimator.daemon.clock import NS, wall_ns
from gritd.estimator.filter.estimate import KPA, TAN_PHI, C
from gritd.tools.cli.command import DONE, FAILED, CommandError, Parser, file_name


def main(argv: Sequence[str]) -> int:
    """Show the bed, or begin a new one. Raises CommandError, ConfigError."""
    arguments = build_parser().parse_args(argv)
    folder = _folder(arguments)
    try:
        if arguments.what == "new":
            folder.mkdir(parents=True, exist_ok=True)
            bed: Bed | None = bed_file.begin(folder, arguments.name, wall_ns() / NS)
        else:
            bed = bed_file.load(folder)
    except (BedError, OSError) as error:
        raise CommandError(error, FAILED) from None

    print("\n".join(lines(folder, bed)))
    return DONE


def _folder(arguments: Namespace) -> Path:
    """That of the logs, given or configured."""
    if arguments.directory is not None:
        return Path(arguments.directory)
    return Path(load(arguments.config or packaged()).settings.logging.directory)


def lines(folder: Path, bed: Bed | None) -> Iterator[str]:
    """What is known of the bed."""
    if bed is None:
        yield f"{folder}: no bed; `gritd bed new NAME` begins one"
        return

    date = time.strftime(bed_file.DATE, time.gmtime(bed.updated))
    yield f"{bed_file.path_of(folder)}: bed {bed.name!r}, {bed.runs} runs, last changed {date}"
    if bed.known is None:
        yield "  the next run begins with the stated prior"
        return

    x, P = bed.known.estimate.x, bed.known.estimate.soil_P
    yield f"  c        {x[C] * KPA:.0f} ± {sqrt(P[C][C]) * KPA:.0f} Pa"
    yield f"  tan φ    {x[TAN_PHI]:.4f} ± {sqrt(P[TAN_PHI][TAN_PHI]):.4f}"


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd bed", description="The bed in the bin: show it, or begin a new one."
    )
    _add_place(parser, default=None)

    commands = parser.add_subparsers(dest="what", metavar="show|new")
    shown = commands.add_parser("show", help="what is known of it")
    new = commands.add_parser(
        "new", help="a bed prepared anew: the next run begins with the stated prior"
    )
    new.add_argument("name", type=file_name, help="of the bed")

    for command in (shown, new):  # behind the word too; there they replace what stands before it
        _add_place(command, default=SUPPRESS)

    return parser


def _add_place(parser: ArgumentParser, default: str | None) -> None:
    parser.add_argument(
        "--config", metavar="F", default=default, help="the testbed: its logging.directory is meant"
    )
    parser.add_argument(
        "--directory", metavar="DIR", default=default, help="the folder of the logs"
    )
