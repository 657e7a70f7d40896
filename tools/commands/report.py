"""`gritd report FILE…`: a page for the lab book on a run or a campaign, without a diagnosis."""

from __future__ import annotations

import importlib
import json
import shlex
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.metadata import versions
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import (
    DAMAGED,
    DONE,
    FAILED,
    CommandError,
    Parser,
    add_configuration,
    os_errors,
)
from gritd.tools.cli.optional import require
from gritd.tools.commands.estimate import (
    check_same_rig,
    configurations_of,
    estimated,
    settings_of,
)
from gritd.tools.report import campaign, lab
from gritd.tools.report.numbers import numbers


def main(argv: Sequence[str]) -> int:
    """Exit 0; 3 where a recording is damaged. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    output = arguments.json or arguments.figure or arguments.output
    files.writable(output)
    if arguments.figure:
        require("matplotlib", "--figure")

    reported = _campaign(arguments, ["gritd", "report", *argv])
    with os_errors(output):
        _write(reported, arguments, output)
    print(output)

    read = [run.run.recording for run in reported.runs]
    damage = [f"{r.path}: {line}" for r in read for line in r.damage]
    print("".join(f"{visible(line)}\n" for line in damage), end="", file=sys.stderr)
    return DAMAGED if damage else DONE


def _write(reported: campaign.ReportedCampaign, arguments: Namespace, output: Path) -> None:
    """Raises OSError; CommandError where there is nothing to draw."""
    if not arguments.figure:
        text = (
            json.dumps(numbers(reported), indent=1) if arguments.json else campaign.render(reported)
        )
        output.write_text(text, encoding="utf-8")
        return

    try:
        importlib.import_module("gritd.tools.report.forces").draw(output, reported)
    except ValueError as error:
        raise CommandError(f"{arguments.files[0]}: {error}; nothing is drawn", FAILED) from None


def _campaign(arguments: Namespace, command: Sequence[str]) -> campaign.ReportedCampaign:
    """The runs on one bed, with what their filter says. Raises CommandError."""
    recordings = [files.recording(path) for path in arguments.files]
    configurations = configurations_of(recordings, arguments)
    given = [settings_of(c, r) for c, r in zip(configurations, recordings, strict=True)]
    check_same_rig(given, recordings)

    repeatability = configurations[0].settings.bed.repeatability
    try:
        runs = estimated(list(zip(given, recordings, strict=True)), repeatability, "report")
    except RecordingError as error:
        raise CommandError(error, DAMAGED) from None

    made = lab.lab_runs(runs)
    return campaign.ReportedCampaign(
        given[0].testbed,
        made,
        {
            "command": shlex.join(command),
            "files": {str(run.run.recording.path): run.sha256 for run in made},
            "configuration": configurations[0].text,
            "versions": versions(),
        },
        [f"{r.path.name}: {line}" for r in recordings for line in r.damage],
    )


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd report",
        description=(
            "Write a page on runs of one bed: forces against the equations, estimates, sensors."
        ),
    )

    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="recordings")
    add_configuration(parser, "for all runs, instead of the recorded configurations")
    form = parser.add_mutually_exclusive_group()
    form.add_argument(
        "--json", type=Path, metavar="OUT", help="the figures as numbers, in place of the page"
    )
    form.add_argument(
        "--figure",
        type=Path,
        metavar="OUT.svg",
        help="T and DP against slip at the width of a column, SVG or PNG, in place of the page",
    )
    form.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("report.html"),
        metavar="OUT.html",
        help="default: report.html",
    )

    return parser
