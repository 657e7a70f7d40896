"""`gritd`: one of the table of commands, imported when it is asked for."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import sys
from collections.abc import Sequence

from gritd import __version__
from gritd.estimator.config.nearest import did_you_mean, listed
from gritd.tools.cli import memory
from gritd.tools.cli.command import Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.terminal import shown
from gritd.tools.commands.table import COMMANDS

WITHOUT_NUMPY = ("status", "monitor")
WITHOUT_SCIPY = ("check-config", "recover")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; its exit code. Errors are one line on standard error, never a traceback."""
    _speak_as_the_terminal_does()
    _calculate_alike_everywhere()
    with shown(sys.stdout, sys.stderr):
        return _main(sys.argv[1:] if argv is None else argv)


def _main(given: Sequence[str]) -> int:
    parser = _parser()
    if not given:
        parser.error("expected a command")
    arguments = parser.parse_args(given)
    return guarded(lambda: _run(arguments.command, arguments.arguments))


def _run(command: str, arguments: Sequence[str]) -> int:
    if command not in WITHOUT_NUMPY:
        memory.reserve(scipy=command not in WITHOUT_SCIPY)
    return int(importlib.import_module(COMMANDS[command][0]).main(arguments))


def _speak_as_the_terminal_does() -> None:
    """A terminal that knows no Greek gets a question mark, and a closed one nothing: no command
    fails for it, least of all the daemon.
    """
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 - or a recording takes it
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def _calculate_alike_everywhere() -> None:
    """One thread for linear algebra: sums in another order end in other digits; commands have their
    own `--jobs`.
    """
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(threads, "1")


def _parser() -> argparse.ArgumentParser:
    listing = "\n".join(f"  {name:14}{summary}" for name, (_, summary) in COMMANDS.items())

    parser = Parser(
        prog="gritd",
        usage="gritd [--help] [--version] COMMAND …",
        description="Learns the soil under a rover wheel while the wheel drives.",
        epilog=f"commands:\n{listing}\n\n`gritd COMMAND --help` explains one.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )

    parser.add_argument("--version", action=_Version, nargs=0, help="show the version")
    parser.add_argument(
        "command", type=_command, metavar="COMMAND", help="one of the commands below"
    )
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)

    return parser


def _command(text: str) -> str:
    """An argparse type: the name of a command."""
    if text not in COMMANDS:
        raise argparse.ArgumentTypeError(
            f"found no command {text[:40]!r}{did_you_mean(text, COMMANDS)}; "
            f"expected one of {listed([*COMMANDS])}"
        )
    return text


class _Version(argparse.Action):
    """Say the version and end."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"gritd {__version__}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
