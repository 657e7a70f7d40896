"""`gritd import RIG PATH… -o OUTDIR`: time series and other rigs' public data to recordings and the
configuration that fits them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gritd.estimator.plugins import (
    IMPORTERS,
    PluginError,
    blamed,
    in_words,
    leave_out,
    left_out,
    refused,
)
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.tools.cli.command import DONE, Parser
from gritd.tools.cli.files import unwritten
from gritd.tools.importers.registry import Importer, aliases, importers


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0. Raises CommandError where a file is not what the importer expects or cannot be
    written.
    """
    args = build_parser().parse_args(argv)
    if (IMPORTERS, args.rig) in left_out:
        raise PluginError(left_out[IMPORTERS, args.rig])
    try:
        written = importers()[args.rig].run(args, lambda line: print(line, flush=True))
    except RecordingError as error:
        raise unwritten(error) from None

    for path in written:
        print(path)
    return DONE


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd import",
        description="Time series and other rigs' data to recordings; see docs/importing.md.",
    )

    commands = parser.add_subparsers(dest="rig", metavar="RIG", required=True)

    for name, rig in importers().items():
        command = commands.add_parser(
            name, aliases=aliases(rig), help=rig.SUMMARY, description=rig.SUMMARY
        )
        command.set_defaults(rig=name)  # by whichever name it was called
        command.add_argument(
            "paths", nargs="+", type=Path, metavar="PATH", help="files, or folders to search"
        )
        command.add_argument(
            "-o",
            "--output",
            type=Path,
            required=name != "series",  # which may only guess
            metavar="OUTDIR",
            help="folder to write into",
        )
        _own_arguments(rig, name, command)

    return parser


def _own_arguments(rig: Importer, name: str, command: argparse.ArgumentParser) -> None:
    """Those of the rig; where a plug-in fails at it, its command stays without them, and is
    refused.
    """
    try:
        rig.add_arguments(command)
    except (Exception, SystemExit) as error:
        if not blamed(error.__traceback__):
            raise
        leave_out(IMPORTERS, name, refused(IMPORTERS, name, f"add_arguments: {in_words(error)}"))


if __name__ == "__main__":
    sys.exit(main())
