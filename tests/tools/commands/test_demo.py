"""`gritd demo` as a user runs it, and the verdict it gives."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.recording.topics import TICK_TOPIC
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.child import Child
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import demo
from gritd.tools.commands import demo_targets as targets
from gritd.tools.report import figure
from tests.drivers.rig import wait_until

GRITD = [sys.executable, "-m", "gritd"]
TRUTH = {"cohesion": 800.0, "tan_phi": 0.6, "shear_modulus": 0.025}


def children(folder):
    """Process numbers whose command line names the folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = entry.read_bytes().split(b"\0")
        except OSError:  # it has just ended
            continue
        if any(str(folder).encode() in word for word in words) and words[3] != b"demo":
            found.append(int(entry.parent.name))
    return found


@pytest.mark.long
def test_a_short_demo_runs_reports_draws_and_verifies(tmp_path):
    folder = tmp_path / "run"
    command = [*GRITD, "demo", "--seconds", "5", "--plant", "linear", "--output", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)

    assert done.returncode == 0, done.stdout + done.stderr

    lines = done.stdout.splitlines()
    assert any(
        re.match(r" +\d+ s \S+ +slip +\S+ W +\S+ N c +\d+ ± +\d+ Pa tan φ", line) for line in lines
    )

    for beginning in (
        "c  ",
        "tan φ",
        "k  ",
        "tick lateness",
        "queue: received",
        "device bus:",
        "testbed: ",
        "log /",
    ):
        assert any(line.startswith(beginning) for line in lines), beginning

    counts = [
        int(n)
        for n in re.search(
            r"received (\d+) = processed (\d+) \+ dropped (\d+) \+ queued (\d+)", done.stdout
        ).groups()
    ]
    assert counts[0] == sum(counts[1:]) > 1000
    assert "identical bit for bit" in done.stdout
    for picture in ("demo.png", "soil.png"):
        assert (folder / picture).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert not children(folder)


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)]
)
def test_a_demo_that_is_stopped_leaves_no_process_behind(number, tmp_path):
    with subprocess.Popen(
        [*GRITD, "demo", "--output", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert wait_until(lambda: len(children(tmp_path)) == 2 or process.poll() is not None, 600.0)
        process.send_signal(number)
        assert process.wait(600) == 130
        assert process.stderr.read() == ""
    assert not children(tmp_path)


def test_a_child_that_dies_is_named_with_its_last_words():
    with (
        pytest.raises(
            CommandError, match=r"the daemon ended early \(exit 2\): gritd: nowhere.yaml: .*"
        ),
        Child(StopRequest(), "daemon", "gritd", "run", "--config", "nowhere.yaml") as child,
    ):
        child.wait_for("device ", 120.0)


def test_an_impossible_length_is_one_line():
    done = subprocess.run([*GRITD, "demo", "--seconds", "1"], capture_output=True, text=True)
    assert done.returncode == 2
    assert (
        done.stderr == "gritd: argument --seconds: found '1'; expected a number from 5 "
        "(see gritd demo --help)\n"
    )


# --- verdict ---


def ticks_ending(seconds=60.0, n=200, **last):
    """/tick of a run whose estimates go from far off to these values; σ of c 20 Pa, of tan φ 0.01,
    of k 0.5 mm.
    """
    ticks = np.zeros(n, TICK_TOPIC.codec.table_dtype)
    ticks["stamp"] = 1_700_000_000_000_000_000 + np.linspace(0, seconds * 1e9, n).astype(np.int64)
    ticks["status"] = 1
    for name, sigma in (("cohesion", 20.0), ("tan_phi", 0.01), ("shear_modulus", 0.0005)):
        ticks[name] = np.linspace(1.3, 1.0, n) * {**TRUTH, **last}[name]
        ticks[f"{name}_sigma"] = sigma
    return ticks


@pytest.mark.parametrize(
    ("plant", "last", "reason"),
    [
        ("linear", {"cohesion": 841.0}, "c is +5.1% off, allowed 5%"),
        ("original", {"cohesion": 841.0}, "c is +2.0 σ off, allowed 2 σ"),
        ("linear", {"tan_phi": 0.587}, "tan φ is -2.2% off, allowed 2%"),
        ("original", {"tan_phi": 0.6181}, "tan φ is +3.0% off, allowed 3%"),
        ("original", {"cohesion": float("nan")}, "c is +nan% off, allowed 10%"),
    ],
)
def test_a_missed_target_is_named_with_its_reason(plant, last, reason):
    found = targets.judge(ticks_ending(**last), TRUTH, plant)
    assert reason in targets.reasons(found)
    assert any("missed" in line for line in targets.table(found))


def test_a_figure_of_a_run_that_never_tracked_is_drawn(tmp_path):
    ticks = ticks_ending()
    ticks["status"] = 0
    ticks["slip"] = np.nan
    figure.draw(tmp_path / "figure.png", ticks, "nothing", None)
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_the_status_line_fits_into_80_columns():
    line = (
        "STANDSTILL slip   0.0%  z  12.3 mm  θ₁ 34.0°  W 105.0 N  T  3.12 N·m  c   1000 ±  300 Pa"
        "  tan φ 0.577 ± 0.060  late 0.05 ms  NOT_SEPARABLE"
    )
    text = f"  60 s {demo._short(line)}"
    assert len(text) < 80 and text.endswith("tan φ 0.577 ± 0.060") and "STANDSTILL" in text
