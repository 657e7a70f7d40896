"""The commands of `gritd`: each a module with `main(argv)`, which gives the exit code, and
`build_parser()`.
"""

from __future__ import annotations

import importlib
from argparse import ArgumentParser

# command -> (module, what it does)
COMMANDS = {
    "init": ("gritd.tools.commands.init", "a folder to work in: configuration and CAN messages"),
    "example": ("gritd.tools.commands.example", "a small simulated campaign to try the others on"),
    "calibrate": (
        "gritd.tools.commands.calibrate",
        "scale and offset of a sensor from known values, into the configuration",
    ),
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
    "view": ("gritd.tools.commands.view", "the running daemon, or recordings, in a browser"),
    "simulate": (
        "gritd.tools.commands.simulate",
        "the forward model alone: a schedule in, a recording out",
    ),
    "compare": (
        "gritd.tools.commands.compare",
        "the forward simulation drawn over recordings, with the residual",
    ),
    "replay": ("gritd.tools.commands.replay", "the on-line filter over recordings"),
    "estimate": (
        "gritd.tools.commands.estimate",
        "what runs on one bed know together of its soil",
    ),
    "bed": ("gritd.tools.commands.bed", "the bed on which the daemon's runs add up: show, new"),
    "report": (
        "gritd.tools.commands.report",
        "a page for the lab book: forces against the equations, estimates, sensors",
    ),
    "diagnose": (
        "gritd.tools.commands.diagnose",
        "where model and recordings differ, and which physics was left out",
    ),
    "runs": ("gritd.tools.commands.runs", "the runs of a folder: rig, load, status, c, tan φ"),
    "diff": (
        "gritd.tools.commands.diff",
        "how two recordings differ in what they were made with",
    ),
    "info": ("gritd.tools.commands.info", "what a recording is and holds: rates, gaps, health"),
    "export": ("gritd.tools.commands.export", "a recording as tables, CSV or Parquet"),
    "effects": (
        "gritd.tools.commands.effects",
        "the physics known beyond the paper: formula, fingerprint, what looks alike",
    ),
    "check-config": (
        "gritd.tools.commands.check_config",
        "check a configuration and show what it implies",
    ),
    "recover": ("gritd.tools.commands.recover", "salvage an unclosed or damaged recording"),
    "import": ("gritd.tools.commands.import_rig", "time series and other rigs' data to recordings"),
    "reproduce": ("gritd.tools.commands.reproduce", "the paper's numbers next to ours"),
    "prove": (
        "gritd.tools.commands.prove",
        "blind trials of diagnose against an independent plant",
    ),
    "bench": (
        "gritd.tools.commands.bench",
        "what a tick, a replay, a force, an update and a message cost here, compared with others",
    ),
    "completion": ("gritd.tools.commands.completion", "the shell completes commands and options"),
}


def parser_of(command: str) -> ArgumentParser:
    """The options of a command, without running it."""
    parser: ArgumentParser = importlib.import_module(COMMANDS[command][0]).build_parser()
    return parser
