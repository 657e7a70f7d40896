"""Runs the examples in one folder, and keeps what they print."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from gritd.tools.cli.progress import Progress
from gritd.tools.dev.manual.examples import EXAMPLES, Example

DOCS = Path(__file__).resolve().parents[3] / "docs"
RUNNING = 45.0  # [s] after which the demo has something to show
COLUMNS = "100"

PLAIN = Example(())

Printed = list[str]  # what each line of an example printed, in their order


def outputs(examples: Mapping[str, Example] = EXAMPLES) -> dict[str, Printed]:
    """Command → what its example printed. Raises RuntimeError where one fails."""
    examples = {name: example for name, example in examples.items() if not example.shown}
    printed = {}
    with TemporaryDirectory() as folder, Progress("examples", len(examples)) as progress:
        for name, text in _each(examples, Path(folder)):
            printed[name] = [each.replace(f"{folder}/", "") for each in text]
            progress.advance()
    return printed


def _each(examples: Mapping[str, Example], folder: Path) -> Iterator[tuple[str, Printed]]:
    for name, example in examples.items():
        if example.during_demo:
            continue

        if example.before:
            _ended(_started(example.before, folder))
        if name == "demo":
            yield from _demo(examples, folder)
        else:
            yield name, [_ended(_started(line, folder), example) for line in example.lines]


def _demo(examples: Mapping[str, Example], folder: Path) -> Iterator[tuple[str, Printed]]:
    """The demo, and what needs a daemon meanwhile: this one, whatever else runs on the machine."""
    demo = _started(examples["demo"].lines[0], folder)
    time.sleep(RUNNING)

    for name, example in examples.items():
        if example.during_demo:
            lines = [f"{line} --socket runs/demo-*/gritd.sock" for line in example.lines]
            yield name, [_ended(_started(line, folder)) for line in lines]
    yield "demo", [_ended(demo, examples["demo"])]


def _started(line: str, folder: Path) -> subprocess.Popen[str]:
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.Popen(
        ["bash", "-c", line],
        cwd=folder,
        env={**os.environ, "PATH": programs, "DOCS": str(DOCS), "COLUMNS": COLUMNS},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # also below `make … &`
    )


def _ended(process: subprocess.Popen[str], example: Example = PLAIN) -> str:
    """What it printed on standard output."""
    while True:
        try:
            out, err = process.communicate(timeout=example.seconds)
            break
        except subprocess.TimeoutExpired:  # again, where it was not ready for the first
            os.killpg(process.pid, signal.SIGINT)

    if process.returncode not in (0, example.code):
        raise RuntimeError(f"{process.args!r}: exit code {process.returncode}: {err}")
    return out
