"""`gritd runs DIR`: the runs of a folder, a line each."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import Any

from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.visible import visible
from gritd.tools.cli.command import DAMAGED, DONE, USAGE, CommandError, Parser, number
from gritd.tools.cli.progress import Progress
from gritd.tools.cli.wording import NOTHING
from gritd.tools.recordings.catalogue import RunEntry, chosen, entry, runs_of
from gritd.tools.service.wording import age

SORTS = {
    "date": lambda run: run.start or 0,
    "name": lambda run: run.path.name,
    "rig": lambda run: run.testbed,
    "load": lambda run: run.load or 0.0,
    "duration": lambda run: run.duration or 0.0,
    "status": lambda run: run.status,
    "c": lambda run: -inf if run.cohesion is None else run.cohesion,
    "phi": lambda run: -inf if run.tan_phi is None else run.tan_phi,
    "size": lambda run: run.size,
}
HEAD = (
    "run",
    "date (UTC)",
    "rig",
    "load",
    "duration",
    "status",
    "c [Pa]",
    "tan φ",
    "size",
    "notes",
)
NUMBERS = (3, 4, 6, 7, 8)  # columns that are set to the right
WIDEST = 40  # letters of a column


def main(argv: Sequence[str]) -> int:
    """Exit 0; 3 where a file cannot be read, which is reported. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    if not arguments.folder.is_dir():
        raise CommandError(
            f"{arguments.folder}: found no folder; expected one with recordings", USAGE
        )

    entries, unread = _read(runs_of(arguments.folder))
    wanted = {name: getattr(arguments, name) for name in ("rig", "status", "text", "load")}
    kept = sorted(chosen(entries, wanted), key=SORTS[arguments.sort], reverse=arguments.reverse)
    if arguments.json:
        print(json.dumps([_plain(each) for each in kept], indent=2))
    else:
        print("\n".join(in_lines(kept, arguments.folder)))

    print("".join(f"gritd: {line}\n" for line in unread), end="", file=sys.stderr)
    return DAMAGED if unread else DONE


def _read(paths: Sequence[Path]) -> tuple[list[RunEntry], list[str]]:
    """What is known of each run, and a line for each file that cannot be read."""
    entries, unread = [], []
    with Progress("looking at runs", len(paths)) as progress:
        for path in paths:
            try:
                entries.append(entry(path))
            except (OSError, RecordingError) as error:
                unread.append(visible(str(error)))
            progress.advance()
    return entries, unread


def in_lines(entries: Sequence[RunEntry], folder: Path) -> Iterator[str]:
    """A table."""
    rows = [HEAD, *(_row(each, folder) for each in entries)]
    widths = [max(len(row[at]) for row in rows) for at in range(len(HEAD))]
    for row in rows:
        cells = (
            text.rjust(width) if at in NUMBERS else text.ljust(width)
            for at, (text, width) in enumerate(zip(row, widths, strict=True))
        )
        yield "  ".join(cells).rstrip()
    if not entries:
        yield f"no run in {folder} fits"


def _row(of: RunEntry, folder: Path) -> tuple[str, ...]:
    more = f" ({of.parts} parts)" if of.parts > 1 else ""
    texts = (
        f"{of.path.relative_to(folder)}{more}",
        NOTHING
        if of.start is None
        else time.strftime("%Y-%m-%d %H:%M", time.gmtime(of.start / 1e9)),
        of.testbed or NOTHING,
        NOTHING if of.load is None else f"{of.load:g} N",
        NOTHING if of.duration is None else age(of.duration),
        of.status,
        _pair(of.cohesion, of.cohesion_sigma, 0),
        _pair(of.tan_phi, of.tan_phi_sigma, 3),
        f"{of.size / 1e6:.1f} MB",
        of.notes,
    )
    return tuple(_short(visible(text)) if at else visible(text) for at, text in enumerate(texts))


def _pair(value: float | None, sigma: float | None, decimals: int) -> str:
    if value is None or sigma is None:
        return NOTHING
    return f"{value:.{decimals}f} ± {sigma:.{decimals}f}"


def _short(text: str) -> str:
    return text if len(text) <= WIDEST else text[: WIDEST - 1] + "…"


def _plain(of: RunEntry) -> dict[str, Any]:
    return {**asdict(of), "path": str(of.path)}


def build_parser() -> Parser:
    parser = Parser(prog="gritd runs", description="The runs of a folder, a line each.")
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path("runs"), metavar="DIR", help="default: runs"
    )
    parser.add_argument("--rig", metavar="TEXT", help="of testbeds with this in their name")
    parser.add_argument("--status", metavar="TEXT", help="that ended so, for instance TRACKING")
    parser.add_argument("--load", type=number(above=0.0), metavar="N", help="within 5 %% of it [N]")
    parser.add_argument(
        "--text", metavar="TEXT", help="with this in name, notes, operator, bed or path"
    )
    parser.add_argument(
        "--sort", choices=tuple(SORTS), default="date", metavar="KEY", help=", ".join(SORTS)
    )
    parser.add_argument("--reverse", action="store_true", help="the last first")
    parser.add_argument("--json", action="store_true", help="all that is known, SI units")
    return parser
