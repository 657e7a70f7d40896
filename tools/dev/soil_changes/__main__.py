"""Is σ honest when the soil changes under the wheel? Random steps, ramps and patches, and hours
without a change.

python -m gritd.tools.dev.soil_changes [--cases 200] [--hours 20] [--seed 1] [--plant original]

Every case draws its soil, its calibration errors (within their stated sigma), its loads and slips
and the change: c by up to ±20 %, tan φ by up to ±6 %, at once, over 20 s, or on a patch of the bed.
The testbed obeys the original equations, its sensors have their stated noise; the filter is that of
the live loop, fed one window after another.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import fields

from gritd.estimator.filter.tuning import CHANGE, TRUST
from gritd.tools.cli.command import DONE, CommandError, Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.progress import Progress
from gritd.tools.dev.soil_changes.cases import RATE, UNCHANGED, packaged_rig
from gritd.tools.dev.soil_changes.tables import quiet, table, unchanged, verdicts


def set_number(text: str) -> None:
    """NAME=VALUE into the filter's tuned numbers, for this experiment.

    Raises CommandError where there is none of that name.
    """
    name, _, value = text.partition("=")
    for tuning in (CHANGE, TRUST):
        if name in {field.name for field in fields(tuning)}:
            # frozen for everybody else
            object.__setattr__(tuning, name, float(value))
            return

    raise CommandError(f"--number {name}: found no such number in estimator/filter/tuning.py")


def main(argv: Sequence[str] | None = None) -> int:
    """Print both tables. Exit 0."""
    arguments = _parser().parse_args(argv)
    for text in arguments.number:
        set_number(text)
    settings, first = packaged_rig(), arguments.seed * 100_000
    drives = (arguments.plant, arguments.rate)

    with Progress("changes", arguments.cases) as progress:
        judgements = []
        for each in verdicts(settings, range(first, first + arguments.cases), *drives):
            judgements.append(each)
            progress.advance()
    if judgements:
        print(table(judgements), flush=True)

    runs = round(arguments.hours * 3600.0 / UNCHANGED)
    with Progress("runs without a change", runs) as progress:
        tracks = []
        for _, track in unchanged(settings, range(first, first + runs), *drives):
            tracks.append(track)
            progress.advance()
    if tracks:
        print(quiet(tracks))
    return DONE


def _parser() -> Parser:
    parser = Parser(
        prog="python -m gritd.tools.dev.soil_changes",
        description="Random changes of the soil, and hours without: is σ honest?",
    )

    parser.add_argument("--cases", type=int, default=200, help="with a change; default 200")
    parser.add_argument("--hours", type=float, default=20.0, help="without one; default 20")
    parser.add_argument("--seed", type=int, default=1, help="of the first case; default 1")
    parser.add_argument("--plant", choices=("original", "linear"), default="original")
    parser.add_argument("--rate", type=float, default=RATE, help="readings a second; default 250")

    parser.add_argument(
        "--number",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="another value of a tuned number (estimator/filter/tuning.py)",
    )

    return parser


if __name__ == "__main__":
    sys.exit(guarded(main))
