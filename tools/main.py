"""`gritd`: one table of commands, each a module of tools with `main(argv)`, imported when it is
asked for.
"""

from __future__ import annotations

import argparse
import importlib
import io
import os
import sys
from collections.abc import Sequence

from gritd import __version__
from gritd.tools.cli import memory
from gritd.tools.cli.command import Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.terminal import shown

# command -> (module, what it does)
COMMANDS = {
    "init": ("gritd.tools.commands.init", "a folder to work in: configuration and CAN messages"),
    "demo": (
        "gritd.tools.commands.demo",
        "the daemon against the simulated testbed on real wires, with verdict and figure",
    ),
    "run": (
        "gritd.tools.commands.run",
        "the daemon: sensors in, c and tan φ out, everything logged",
    ),
    "status": (
        "gritd.tools.commands.status",
        "one report of the running daemon, for people or scripts",
    ),
    "monitor": ("gritd.tools.commands.monitor", "the running daemon in a terminal"),
    "simulate": (
        "gritd.tools.commands.simulate",
        "the forward model alone: a schedule in, a recording out",
    ),
    "compare": (
        "gritd.tools.commands.compare",
        "the forward simulation drawn over recordings, with the residual",
    ),
    "replay": ("gritd.tools.commands.replay", "the on-line filter over recordings"),
    "diagnose": (
        "gritd.tools.commands.diagnose",
        "where model and recordings differ, and which physics was left out",
    ),
    "check-config": (
        "gritd.tools.commands.check_config",
        "check a configuration and show what it implies",
    ),
    "recover": ("gritd.tools.commands.recover", "salvage an unclosed or damaged recording"),
    "import": ("gritd.tools.commands.import_rig", "other rigs' public data to recordings"),
    "reproduce": ("gritd.tools.commands.reproduce", "the paper's numbers beside ours"),
    "prove": (
        "gritd.tools.commands.prove",
        "blind trials of diagnose against an independent plant",
    ),
    "bench": (
        "gritd.tools.commands.bench",
        "what a tick, a replay, a force, an update and a message cost here",
    ),
}


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
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 - or a recording takes its place
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
        "command", choices=COMMANDS, metavar="COMMAND", help="one of the commands below"
    )
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)

    return parser


class _Version(argparse.Action):
    """Say the version and end."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"gritd {__version__}")
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())
