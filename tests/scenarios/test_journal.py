"""What goes wrong is said in the journal: once, with its number, and once more where it ends."""

from __future__ import annotations

import random
import re
import signal
import time
from contextlib import suppress

import pytest
import yaml

from tests.scenarios.rig import TESTBED, WIRES, driven, log_lines, service

SAID = "silence, garbage, counter jumps, a stopped process"
MANY = 12  # lines for one fault, both ends included, whatever else they bring about


class Meddled:
    """The encoders' wire, which can be mute, and whose counter can jump."""

    def __init__(self, wires, rng):
        self._send, self._rng, self.mute, self.jumping = wires.encoders.send, rng, False, False
        self.bits = 32  # of the counters
        wires.encoders.send = self.send

    def send(self, key, values, device_us):
        if self.mute:
            return
        if self.jumping and key == "wheel_encoder":
            values = tuple(value + self._rng.randint(-(1 << 24), 1 << 24) for value in values)
        self._send(key, tuple(value % (1 << self.bits) for value in values), device_us)


def silence(wires, daemon, encoders, scale):
    """Until the status says that the filter is unfed, and on."""
    encoders.mute, began = True, time.monotonic()
    report = daemon.wait_status(lambda report: not report["healthy"])
    took = time.monotonic() - began
    assert "wheel_encoder" in report["unfed"] and not report["hanging"]
    time.sleep(2.0 * scale)
    encoders.mute = False
    daemon.wait_status(lambda report: report["healthy"])
    return took


def garbage(wires, daemon, encoders, scale):
    """1.6 MB, or 8 MB, as fast as it is taken."""
    noise, sent = random.Random(1).randbytes(2048), 0
    while sent < 800 * scale:
        with suppress(BlockingIOError):
            wires.encoders.plug.send(noise)
            sent += 1
        time.sleep(0.001)


def jumps(wires, daemon, encoders, scale):
    encoders.jumping = True
    time.sleep(2.0 * scale)
    encoders.jumping = False


def stopped(wires, daemon, encoders, scale):
    daemon.signal(signal.SIGSTOP)
    time.sleep(1.0 * scale)
    daemon.signal(signal.SIGCONT)


def wraps(wires, daemon, encoders, scale):
    """Silence of counters that wrap."""
    encoders.mute = True
    time.sleep(2.0 * scale)
    encoders.mute = False


def narrow():
    """The encoders' channels with counters of 16 bits, for the configuration."""
    channels = yaml.safe_load(TESTBED.text)["channels"]
    names = ("wheel_encoder", "carriage_encoder")
    return {"channels": {name: {**channels[name], "bits": 16} for name in names}}


FAULTS = {
    "silence": (silence, r"channels? .*wheel_encoder.*: nothing usable arrives", "well again"),
    "garbage": (garbage, r"device encoders: bytes of garbage: \d+", r"over after .* \d+ in all"),
    "jumps": (jumps, r"jumps of an encoder: \d+", r"jumps of an encoder: over after .* \d+ in all"),
    "wraps": (wraps, r"device encoders: turns unknown, .*: \d+", "well again"),
    "stopped": (stopped, r"ticks missed: \d+", ""),
}


@pytest.mark.parametrize("scale", [1.0, pytest.param(5.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("fault", FAULTS)
def test_it_is_said(tmp_path, fault, scale, figure):
    bring_about, begins, ends = FAULTS[fault]
    changes = narrow() if fault == "wraps" else {}
    with service(tmp_path, driven(90.0, 1, skip=1.0), **changes) as (wires, daemon):
        encoders = Meddled(wires, random.Random(2))
        encoders.bits = 16 if fault == "wraps" else 32
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        before = len(daemon.said)
        took = bring_about(wires, daemon, encoders, scale)
        daemon.until(lambda: said(daemon, before, begins), f"did not say {begins}")
        daemon.until(lambda: said(daemon, before, ends), f"did not say {ends}")
        lines = daemon.said[before:]
        daemon.stop()

    figure(SAID, WIRES, f"{fault}: lines in the journal", len(lines), "", MANY)
    if took is not None:
        figure(SAID, WIRES, "from silence to unhealthy", took, "s", 1.6, real=True)
    logged = log_lines(daemon.path())
    assert any(re.search(begins, line) for line in logged), "and in /log"


def said(daemon, before, words):
    return [line for _, line in daemon.said[before:] if re.search(words, line)]
