"""`gritd demo`: the daemon against the simulated testbed, as a user would run it, and a verdict on
what it found.
"""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path

from gritd.estimator.config.configuration import load
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.recording.topics import TOPICS
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.child import Child, interruptible
from gritd.tools.cli.command import DONE, FAILED, Parser
from gritd.tools.cli.optional import missing
from gritd.tools.cli.terminal import LiveLine
from gritd.tools.commands import demo_targets as targets
from gritd.tools.service.client import SOCKET
from gritd.tools.testbed.plant import PlantKind
from gritd.tools.testbed.testbed import NAME, PLAYED, add_play

READY = 300.0  # [s] the longest that testbed or daemon may take to start, on a starved computer
DEVICES = 2  # of the packaged testbed


def main(argv: Sequence[str]) -> int:
    """Exit 0 if every target is met, 1 with the reason if not. Raises CommandError where a process
    fails.
    """
    arguments = build_parser().parse_args(argv)
    folder = Path(arguments.output or Path("runs") / time.strftime("demo-%Y%m%d-%H%M%S"))
    folder.mkdir(parents=True, exist_ok=True)
    with interruptible() as stop:
        last_words = run(folder, arguments, stop)
    return conclude(folder, arguments.plant, last_words)


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd demo", description="Run the daemon against the simulated testbed on real wires."
    )
    parser.add_argument(
        "--output", metavar="DIR", help="folder of the run; default runs/demo-DATE-TIME"
    )
    add_play(parser)
    parser.add_argument("--view", action="store_true", help="show it in a browser meanwhile")

    return parser


# --- the run ---


def run(folder: Path, arguments: Namespace, stop: StopRequest) -> list[str]:
    """Testbed and daemon side by side for the given time; the daemon's closing lines."""
    options = [
        "--seconds",
        str(arguments.seconds),
        "--seed",
        str(arguments.seed),
        "--plant",
        arguments.plant,
    ]
    options += ["--folder", str(folder), "--can", arguments.can, "--wait"]

    with Child(stop, "testbed", "gritd.tools.testbed.testbed", *options) as testbed:
        config = _after(testbed.wait_for("configuration ", READY))
        print(
            f"{arguments.plant} plant, seed {arguments.seed}, {arguments.seconds:g} s; "
            f"everything in {folder}"
        )
        with Child(stop, "daemon", "gritd", "run", "--config", config, "--name", "demo") as daemon:
            _wait_for_devices(daemon)
            with _shown(stop, config) if arguments.view else nullcontext():
                testbed.tell("play")
                _follow(daemon, testbed, arguments.seconds)
                return daemon.stop()


@contextmanager
def _shown(stop: StopRequest, config: str) -> Iterator[None]:
    """The page of `gritd view` beside the daemon of this configuration. Raises CommandError."""
    socket = Path(load(config).settings.logging.directory) / SOCKET
    with Child(stop, "view", "gritd", "view", "--any-port", "--socket", str(socket)) as view:
        print(view.wait_for("view ", READY), flush=True)
        yield


def _after(line: str) -> str:
    return line.split(" ", 1)[1]


def _wait_for_devices(daemon: Child) -> None:
    for _ in range(DEVICES):
        daemon.wait_for("device ", READY)


def _follow(daemon: Child, testbed: Child, seconds: float) -> None:
    """Show the daemon's status until the time is over."""
    start = time.monotonic()
    status = LiveLine(sys.stdout)

    try:
        while (elapsed := time.monotonic() - start) < seconds:
            testbed.check()
            line = daemon.line(min(0.2, seconds - elapsed))
            if line and " slip " in line:
                status.show(f"{elapsed:4.0f} s {_short(line)}")
    finally:
        status.keep()


def _short(line: str) -> str:
    """Of the daemon's status line what fits into 80 columns: status, slip, load, c and tan φ."""
    parts = [
        re.search(p, line)
        for p in (r"^\S+", r"slip +\S+", r"W +\S+ N", r"c +\d+ ± +\d+ Pa", r"tan φ \S+ ± \S+")
    ]
    status, *rest = (part.group() if part else "" for part in parts)
    return " ".join((f"{status:10}", *rest))


# --- the verdict ---


def conclude(folder: Path, plant: PlantKind, last_words: Sequence[str]) -> int:
    """Read the recording back, print what it shows, draw it, verify its replay."""
    recording = _recording(folder)
    ticks, loop = recording.arrays("/tick"), recording.arrays("/loop")
    soil = json.loads((folder / f"{NAME}.truth.json").read_text(encoding="utf-8"))["soil"]

    estimates = targets.judge(ticks, soil, plant)
    table = [*targets.table(estimates), *targets.without_correction(recording, soil)]
    print("\n".join([*table, "", *targets.punctuality(loop), *_counters(folder, last_words)]))

    print(f"log {recording.path}")
    print(
        f"figures {_drawn(folder, ticks, targets.headline(estimates, plant, ticks), soil)}",
        flush=True,
    )

    missed = [*targets.reasons(estimates), *_replay(recording.path)]

    for reason in missed:
        print(f"target missed: {reason}", file=sys.stderr)
    if not missed:
        print(targets.praise(estimates))
    return FAILED if missed else DONE


def _drawn(folder: Path, ticks: Rows, title: str, soil: Mapping[str, float]) -> str:
    """The paths of the figures, or why there are none."""
    if how := missing("matplotlib"):
        return f"not drawn: {how}"
    picture, soil_picture = folder / "demo.png", folder / "soil.png"
    importlib.import_module("gritd.tools.report.figure").draw(picture, ticks, title, soil)
    importlib.import_module("gritd.tools.report.collapse").draw(soil_picture, ticks, soil)
    return f"{picture}, {soil_picture}"


def _recording(folder: Path) -> Recording:
    newest = max(folder.glob("demo-*.mcap"), key=lambda path: path.stat().st_mtime)
    return read(newest, TOPICS)


def _counters(folder: Path, last_words: Sequence[str]) -> list[str]:
    """The daemon's own account, and the testbed's."""
    account = [
        line for line in last_words if line.startswith(("queue:", "device ", "loop:", "log "))
    ]

    played = folder / PLAYED
    if played.exists():
        p = json.loads(played.read_text(encoding="utf-8"))
        lost = ", ".join(f"{name} {count}" for name, count in p["lost"].items())
        account.append(
            f"testbed: {p['readings']} readings sent, late by {p['late_half'] * 1e3:.2f} ms (50 %),"
            f" {p['late_most'] * 1e3:.2f} ms (99 %), {p['late_worst'] * 1e3:.2f} ms (max); "
            f"nobody took: {lost}"
        )

    return account


def _replay(path: Path) -> list[str]:
    """Run `gritd replay --verify`; reasons why it failed."""
    command = [sys.executable, "-m", "gritd", "replay", str(path), "--verify"]
    code = subprocess.run(command, check=False).returncode
    return [] if code == 0 else [f"replay of {path} is not identical (exit {code})"]
