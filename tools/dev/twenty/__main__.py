"""Twenty campaigns whose diagnoses must be the same, byte for byte, before and after a change.

    python -m gritd.tools.dev.twenty make FOLDER --gritd PATH/TO/gritd [--real DIR]
    python -m gritd.tools.dev.twenty diagnose FOLDER OUT --gritd PATH/TO/gritd [--jobs 2]
                                              [--only NAME …]
    python -m gritd.tools.dev.twenty compare A B

Fifteen campaigns are simulated, five are imported from other laboratories' recordings in DIR. Make
them once, with the version before the change, and diagnose them with both versions. Nothing of the
engine is imported: `gritd` is an executable here, so the layout of its code does not matter.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gritd.tools.dev.twenty.compare import compare
from gritd.tools.dev.twenty.diagnose import diagnose
from gritd.tools.dev.twenty.make import make


def main(argv: Sequence[str]) -> int:
    """Exit 1 where a diagnosis failed or differs."""
    given = _parser().parse_args(argv)
    if given.command == "compare":
        return compare(given.one, given.other)
    gritd = given.gritd.absolute()
    if given.command == "make":
        return make(given.folder, gritd, given.real)
    return diagnose(given.folder, given.out, gritd, given.jobs, given.only)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="twenty", description="Twenty campaigns that must be diagnosed alike."
    )
    commands = parser.add_subparsers(dest="command", required=True)

    making = commands.add_parser("make", help="simulate and import the campaigns")
    making.add_argument("folder", type=Path)
    making.add_argument("--real", type=Path, metavar="DIR", help="other laboratories' files")

    diagnosing = commands.add_parser("diagnose", help="diagnose every campaign of a folder")
    diagnosing.add_argument("folder", type=Path)
    diagnosing.add_argument("out", type=Path)
    diagnosing.add_argument("--jobs", type=int, default=2, help="campaigns at once")
    diagnosing.add_argument("--only", nargs="+", default=[], metavar="NAME")
    for command in (making, diagnosing):
        command.add_argument("--gritd", type=Path, required=True, help="the executable")

    comparing = commands.add_parser("compare", help="the results of two versions")
    comparing.add_argument("one", type=Path)
    comparing.add_argument("other", type=Path)
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
