"""What goes wrong is said in the journal: once, with its number, and once more where it ends.

How much of it there is depends on the computer's load. So the journal is held to what the daemon
itself counted.
"""

from __future__ import annotations

import random
import re
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import NamedTuple

import pytest
import yaml

from gritd.tools.service.incidents import OVER
from tests.scenarios.recorded import log_lines
from tests.scenarios.rig import TESTBED, WIRES, driven, service

SAID = "silence, garbage, counter jumps, a stopped process"
MANY = 12  # lines for one fault, both ends included, whatever else they bring about


class Meddled:
    """The encoders' wire, which can be mute, and whose counter can jump."""

    def __init__(self, wires, rng):
        self.plug = wires.encoders.plug
        self._send, self._rng, self.mute, self.jumping = wires.encoders.send, rng, False, False
        self.bits = 32  # of the counters
        wires.encoders.send = self.send

    def send(self, key, values, device_us):
        if self.mute:
            return
        if self.jumping and key == "wheel_encoder":
            values = tuple(value + self._rng.randint(-(1 << 24), 1 << 24) for value in values)
        self._send(key, tuple(value % (1 << self.bits) for value in values), device_us)


# ---- what is done --------------------------------------------------------------------------------


def silence(daemon, encoders, scale):
    """Until the status says that the filter is unfed, and on; how long that took [s]."""
    encoders.mute, began = True, time.monotonic()
    report = daemon.wait_status(lambda report: "wheel_encoder" in report["unfed"])
    took = time.monotonic() - began
    assert not report["healthy"]

    time.sleep(2.0 * scale)
    encoders.mute = False
    daemon.wait_status(lambda report: report["healthy"])
    return took


def garbage(daemon, encoders, scale):
    """1.6 MB, or 8 MB, as fast as it is taken."""
    noise, sent = random.Random(1).randbytes(2048), 0
    while sent < 800 * scale:
        with suppress(BlockingIOError):
            encoders.plug.send(noise)
            sent += 1
        time.sleep(0.001)


def jumps(daemon, encoders, scale):
    """Until the filter has seen many."""
    before = daemon.status()["tick"]["jumps"]
    encoders.jumping = True
    daemon.wait_status(lambda report: report["tick"]["jumps"] >= before + 200 * scale)
    encoders.jumping = False


def stopped(daemon, encoders, scale):
    """Until the loop has counted what it missed."""
    before = daemon.status()["loop"]["missed"]
    daemon.signal(signal.SIGSTOP)
    time.sleep(1.0 * scale)
    daemon.signal(signal.SIGCONT)
    daemon.wait_status(lambda report: report["loop"]["missed"] > before)


def wraps(daemon, encoders, scale):
    """Silence of counters that wrap, until it has been noticed, and what that means as well."""
    before = unknown_turns(daemon.status())
    encoders.mute = True
    time.sleep(2.0 * scale)
    daemon.wait_status(lambda report: "wheel_encoder" in report["unfed"])
    encoders.mute = False
    daemon.wait_status(lambda report: unknown_turns(report) > before)


def unknown_turns(report):
    return report["devices"]["encoders"]["turns_unknown"]


def narrow():
    """The encoders' channels with counters of 16 bits, for the configuration."""
    channels = yaml.safe_load(TESTBED.text)["channels"]
    names = ("wheel_encoder", "carriage_encoder")
    return {"channels": {name: {**channels[name], "bits": 16} for name in names}}


# ---- what is said --------------------------------------------------------------------------------


class Fault(NamedTuple):
    """counted: of a report, how often it has happened, by how the lines about it begin.
    ended: the lines that say its beginning and its end, where it lasts.
    """

    bring_about: Callable
    counted: Mapping[str, Callable]
    ended: tuple[str, ...] = ()


STALE = (r"channels? .*wheel_encoder.*: nothing usable arrives", r"wheel_encoder.*: well again")
TURNS = "device encoders: turns unknown, an encoder was silent while its counter may have wrapped"
GARBAGE = "device encoders: bytes of garbage"
FAULTS = {
    "silence": Fault(silence, {}, STALE),
    "garbage": Fault(garbage, {GARBAGE: lambda r: r["devices"]["encoders"]["garbage"]}),
    "jumps": Fault(jumps, {"jumps of an encoder": lambda report: report["tick"]["jumps"]}),
    "wraps": Fault(wraps, {TURNS: unknown_turns}, STALE),
    "stopped": Fault(stopped, {"ticks missed": lambda report: report["loop"]["missed"]}),
}


@pytest.mark.parametrize("scale", [1.0, pytest.param(5.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", FAULTS)
def test_it_is_said(tmp_path, name, scale, figure):
    """All that the daemon counted is reported, and in few lines."""
    fault = FAULTS[name]
    changes = narrow() if name == "wraps" else {}
    with service(tmp_path, driven(90.0, 1, skip=1.0), **changes) as (wires, daemon):
        encoders = Meddled(wires, random.Random(2))
        encoders.bits = 16 if name == "wraps" else 32
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        before = len(daemon.said)
        took = fault.bring_about(daemon, encoders, scale)
        wait_until_told(daemon, before, fault)
        lines = daemon.said[before:]
        daemon.stop()

    about = [(when, line) for when, line in lines if line.startswith(tuple(fault.counted))]
    assert len(about) <= 2 + 2 * (span(about) // OVER) if fault.counted else not about
    figure(SAID, WIRES, f"{name}: lines in the journal", len(lines), "", MANY, real=True)
    if took is not None:
        figure(SAID, WIRES, "from silence to unhealthy", took, "s", 1.6, real=True)

    logged = log_lines(daemon.path())
    assert all(line in logged for _, line in about), "and in /log"
    assert all(any(re.search(words, line) for line in logged) for words in fault.ended)


def wait_until_told(daemon, before, fault):
    """Until the lines say as many as the daemon has counted, and that what lasted is over."""
    report = daemon.status()
    for what, counted in fault.counted.items():
        happened = counted(report)
        assert happened > 0
        daemon.until(lambda w=what, n=happened: reported(daemon, w) >= n, f"not all told of {what}")

    for words in fault.ended:
        daemon.until(lambda w=words: matching(daemon.said[before:], w), f"did not say {words}")


def reported(daemon, what):
    """How many the lines about a counter tell of, since the start."""
    before, now = 0, 0  # in what is over, in what goes on
    for line in [line for _, line in list(daemon.said) if line.startswith(f"{what}: ")]:
        if in_all := re.search(r"(\d+) in all", line):
            now = int(in_all[1])
        else:
            before, now = before + now, int(line.removeprefix(f"{what}: ").split()[0])
        if ": over after" in line:
            before, now = before + now, 0
    return before + now


def matching(said, words):
    return [line for _, line in said if re.search(words, line)]


def span(lines):
    """From the first of the lines to the last [s]."""
    return lines[-1][0] - lines[0][0] if lines else 0.0
