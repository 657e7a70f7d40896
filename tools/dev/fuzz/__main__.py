"""Inputs that nobody meant, at every place where bytes or values come in: `python -m
gritd.tools.dev.fuzz [--share 0.01]`.

Seeded and bounded. Each target makes a case from a random generator, hands it over, and says in a
line what is wrong with the answer; an exception that is not the stated one is wrong too.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from gritd.tools.cli.command import DONE, FAILED, Parser
from gritd.tools.dev.fuzz.targets import TARGETS, run


def main(argv: Sequence[str] | None = None) -> int:
    """Exit 1 if any case of any target is answered wrongly."""
    parser = Parser(
        prog="python -m gritd.tools.dev.fuzz",
        description="Fuzz every place where bytes or values come in.",
    )
    parser.add_argument(
        "--share", type=float, default=1.0, help="of the full number of cases; default 1"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", metavar="WORD", default="", help="targets whose name holds this")

    arguments = parser.parse_args(argv)

    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for target in TARGETS:
            if arguments.only in target.name:
                failed += run(
                    target,
                    max(1, round(target.cases * arguments.share)),
                    arguments.seed,
                    Path(folder),
                )

    return FAILED if failed else DONE


if __name__ == "__main__":
    sys.exit(main())
