"""How far a diagnosis moves when a tuned number is halved or doubled.

    python -m gritd.tools.dev.sensitivity CAMPAIGNS RESULTS [--only NAME …] [--fields ROOM.FIELD …]
                                          [--jobs N] [--minutes M] [--out FILE]

CAMPAIGNS is a folder of campaigns, each of recordings and one configuration (`twenty make` makes
some). Each is diagnosed twice as it is, to see what it reads and to fork from. RESULTS is a file
that keeps what has been diagnosed: the same command goes on where it was stopped. The table is
written after every campaign; what stands in it under "What it shows" stays. `--minutes 0` only
writes it.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from gritd.tools.cli.command import Parser
from gritd.tools.dev.sensitivity.numbers import named
from gritd.tools.dev.sensitivity.page import by_hand, page
from gritd.tools.dev.sensitivity.runs import DiagnosedRuns, Kept, run

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def main(argv: Sequence[str]) -> int:
    """Exit 0; 2 for usage."""
    given = _parser().parse_args(argv)
    folders = {f.name: f.resolve() for f in sorted(given.campaigns.iterdir()) if f.is_dir()}
    _check(given, folders)
    chosen = [folders[name] for name in given.only or folders]

    def write(runs: DiagnosedRuns) -> None:
        of = f"It was begun on {Kept(given.results).begun}."
        shown = by_hand(given.out.read_text(encoding="utf-8")) if given.out.exists() else ""
        given.out.write_text(page(runs, given.fields, folders, of, shown), encoding="utf-8")
        print(f"{given.out}: {len(runs.moved)} diagnoses of {len(runs.cases(given.fields))}")

    for runs in run(chosen, given.results, given.fields, given.jobs, given.minutes):
        write(runs)
    write(Kept(given.results).runs())
    return 0


def _check(given: argparse.Namespace, campaigns: dict[str, Path]) -> None:
    if missing := [name for name in given.only if name not in campaigns]:
        raise SystemExit(f"{given.campaigns}: found no campaign {', '.join(missing)}")
    for text in given.fields:
        try:
            named(text)
        except ValueError as error:
            raise SystemExit(f"--fields: {error}") from None


def _parser() -> argparse.ArgumentParser:
    parser = Parser(description="What halved and doubled numbers change in a diagnosis.")
    parser.add_argument("campaigns", type=Path)
    parser.add_argument("results", type=Path, help="file of what has been diagnosed")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="campaigns, in this order"
    )
    parser.add_argument("--fields", nargs="+", default=[], metavar="ROOM.FIELD", help="numbers")

    parser.add_argument("--jobs", type=int, default=1, help="diagnoses at once")
    parser.add_argument("--minutes", type=float, default=math.inf, help="end after so long")
    parser.add_argument("--out", type=Path, default=Path("sensitivity.md"), metavar="FILE")

    return parser


def _with_one_thread() -> None:
    """Begins this program anew with one thread of linear algebra a process: the libraries read the
    environment when they are loaded.
    """
    if any(os.environ.get(name) != "1" for name in THREADS):
        os.environ.update(dict.fromkeys(THREADS, "1"))
        os.execv(
            sys.executable, [sys.executable, "-m", "gritd.tools.dev.sensitivity", *sys.argv[1:]]
        )


if __name__ == "__main__":
    _with_one_thread()
    sys.exit(main(sys.argv[1:]))
