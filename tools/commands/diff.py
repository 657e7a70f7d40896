"""`gritd diff A B`: how two recordings differ in what they were made with, a line a key."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from gritd.estimator.recording.glance import glance
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.recording import Recording
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import DONE, USAGE, CommandError, Parser
from gritd.tools.recordings.difference import Difference, differences

NONE = "nothing"


def main(argv: Sequence[str]) -> int:
    """Exit 0. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    found = differences(made(arguments.first), made(arguments.second))

    if arguments.json:
        print(json.dumps([{**vars(each), "matters": each.matters} for each in found], indent=2))
    else:
        print("\n".join(visible(line) for line in in_lines(found)))
    return DONE


def made(path: Path) -> Recording:
    """A recording's metadata. Raises CommandError."""
    try:
        return glance(path, {}, 0)
    except RecordingError as error:
        raise files.unread(path, error) from None
    except OSError as error:
        found = (error.strerror or str(error)).lower()
        raise CommandError(f"{path}: found {found}; expected a recording", USAGE) from None


def in_lines(found: Sequence[Difference]) -> Iterator[str]:
    """First what may give another estimate."""
    if not found:
        yield "no difference in configuration, run and versions"
        return
    width = max(len(each.key) for each in found)
    groups = (("may change the estimate:", True), ("does not change it:", False))
    for title, matters in groups:
        lines = [each for each in found if each.matters == matters]
        if lines:
            yield title
            yield from (
                f"  {each.key:{width}}  {each.first or NONE} → {each.second or NONE}"
                for each in lines
            )


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd diff",
        description="How two recordings differ in configuration, calibration, run and versions.",
    )
    parser.add_argument("first", type=Path, metavar="A")
    parser.add_argument("second", type=Path, metavar="B")
    parser.add_argument("--json", action="store_true", help="as a list of keys")

    return parser
