"""`gritd monitor`: trouble first, within 80 by 24, redrawn in place."""

from __future__ import annotations

import os
import pty
import re
import signal
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from gritd.estimator.messages.status import CHANNEL_BITS
from gritd.tools.commands import monitor
from gritd.tools.service.wording import SHOWN
from tests.estimator.daemon.reports import REPORT, publishing

ROOT = Path(__file__).parents[3]


@pytest.fixture
def publisher(tmp_path):
    with publishing(tmp_path / "gritd.sock") as publisher:
        yield publisher


def test_the_monitor_shows_channels_devices_and_log(publisher, capsys):
    assert monitor.main(["--socket", str(publisher.path), "--once"]) == 0
    out = capsys.readouterr().out
    for words in ("wheel_encoder stale", "WAITING", "cannot open", "7 ticks, 2 missed", "run.mcap"):
        assert words in out


TICK = {
    **{key: 12345.678 for _, name, sigma, *_ in SHOWN for key in (name, sigma)},
    **{"separability": 1.0, "consistency": 1.0, "updates": 10**6, "resets": 10},
    **dict.fromkeys(("late", "duplicates", "invalid", "jumps"), 10**5),
}
LATE = dict.fromkeys(("late_50", "late_99", "late_999", "late_max"), 0.01234)
DEVICE = {**REPORT["devices"]['a"b'], "state": "OPEN", "rate": 1000.0, "last_error": ""}
HEALTHY = {
    **REPORT,
    **{
        "status": "STANDSTILL",
        "flags": ["NOT_SEPARABLE", "K_ESTIMATED"],
        "uptime": 1e6,
        "tick": TICK,
    },
    "channels": dict.fromkeys(CHANNEL_BITS, "stale"),
    "loop": {**REPORT["loop"], **LATE, "ticks": 10**8, "missed": 10**5},
    "devices": {"encoders": DEVICE, "bus": DEVICE},
}


def test_the_monitor_fits_a_terminal_of_80_by_24_and_tells_of_trouble_first():
    picture = list(monitor.lines(HEALTHY))
    assert len(picture) <= 24 and max(map(len, picture)) <= 80
    log = {
        **REPORT["log"],
        "state": "degraded",
        "error": "run.mcap: cannot write: No space left on device",
    }
    sick = list(monitor.lines({**REPORT, "hanging": "loop", "log": log}))
    assert sick[1:4] == [
        "! hanging: loop",
        '! a"b WAITING cannot open',
        "! log degraded run.mcap: cannot write: No space left on device",
    ]


def test_the_monitor_redraws_in_place_and_leaves_the_terminal_as_it_was(publisher):
    """On a pseudo-terminal of 40 columns and 10 lines: what is wider or longer is cut, never
    wrapped.
    """
    master, slave = pty.openpty()
    termios.tcsetwinsize(slave, (10, 40))
    command = [sys.executable, "-m", "gritd", "monitor", "--socket", str(publisher.path)]
    before = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # if we ignore it, so does a child
    child = subprocess.Popen(command, stdout=slave, cwd=ROOT, env={**os.environ, "TERM": "xterm"})
    signal.signal(signal.SIGINT, before)
    os.close(slave)
    seen = ""
    while seen.count(monitor.HOME) < 3:
        seen += os.read(master, 4096).decode(errors="replace")
    child.send_signal(signal.SIGINT)
    assert child.wait(120) == 130
    seen += os.read(master, 4096).decode(errors="replace")
    os.close(master)
    assert seen.startswith(monitor.OPEN) and seen.endswith(monitor.CLOSE)
    picture = re.sub(r"\033\[[?\d]*[A-Za-z]", "", seen.split(monitor.HOME)[2]).splitlines()
    assert (
        len(picture) == 10
        and max(map(len, picture)) <= 40
        and picture[1] == '! a"b WAITING cannot open'
    )


def test_q_leaves_the_monitor_and_the_terminal_as_it_was(publisher):
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    command = [sys.executable, "-m", "gritd", "monitor", "--socket", str(publisher.path)]
    child = subprocess.Popen(
        command, stdin=slave, stdout=slave, cwd=ROOT, env={**os.environ, "TERM": "xterm"}
    )
    seen = b""
    while monitor.HOME.encode() not in seen:
        seen += os.read(master, 4096)
    os.write(master, b"q")
    assert child.wait(120) == 0
    assert termios.tcgetattr(slave) == before
    os.close(slave)
    os.close(master)
