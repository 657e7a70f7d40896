"""Devices that vanish, and wires that carry garbage."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import time

import numpy as np
import pytest

from gritd.estimator.messages.status import CHANNEL_BITS, Status
from tests.drivers.rig import damage
from tests.scenarios.recorded import rows, verified
from tests.scenarios.rig import ROOT, WIRES, driven, service

ENCODERS = CHANNEL_BITS["wheel_encoder"] | CHANNEL_BITS["carriage_encoder"]
UNPLUGGED = "device unplugged and back"
GARBAGE = "serial garbage, bad CRC, truncated frame"
SHARED = "second daemon on a port of the first"


def unplug_and_back(wires, daemon, rng, cycles):
    """Pull the encoders' plug again and again; when it was pulled and put back [ns since the
    epoch].
    """
    pulled, back = [], []
    for cycle in range(cycles):
        time.sleep(rng.uniform(0.25, 0.4))
        pulled.append(time.time_ns())
        wires.encoders.plug.unplug()
        daemon.heard("device encoders WAITING", cycle + 1)
        daemon.wait_status(lambda report: report["channels"]["wheel_encoder"] == "stale")
        time.sleep(rng.uniform(0.0, 0.1))
        wires.encoders.plug.plug_in()
        back.append(time.time_ns())
        daemon.heard("device encoders OPEN", cycle + 2)
        daemon.wait_status(lambda report: report["channels"]["wheel_encoder"] == "ok")
    return np.array(pulled), np.array(back)


def delays(ticks, moments, condition):
    """From each moment [ns] to the first tick after it that fulfils the condition, by the daemon's
    own clock [s].
    """
    stamps = ticks["stamp"][condition]
    return [(stamps[np.searchsorted(stamps, moment)] - moment) * 1e-9 for moment in moments]


def cycled(tmp_path, seed, cycles):
    rng = np.random.default_rng(seed)
    with service(tmp_path, driven(60.0 + 4.0 * cycles, seed, skip=2.0)) as (wires, daemon):
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        before = daemon.descriptors()
        pulled, back = unplug_and_back(wires, daemon, rng, cycles)
        leaked = max(daemon.descriptors() - before, 0)
        daemon.stop()
    ticks = rows(daemon.path(), "/tick")
    stale = (ticks["stale"] & ENCODERS) > 0
    return daemon, ticks, delays(ticks, pulled, stale), delays(ticks, back, ~stale), leaked


def test_unplugged_and_back(tmp_path, seed, figure):
    daemon, ticks, noticed, back, leaked = cycled(tmp_path, seed, 4)
    frozen = ticks[ticks["status"] == Status.STALE]
    assert len(frozen) and not np.any(frozen["torque_accepted"])
    for name in ("cohesion", "tan_phi", "cohesion_sigma"):
        held = ticks[name][np.flatnonzero(ticks["status"] == Status.STALE)]
        before = ticks[name][np.flatnonzero(ticks["status"] == Status.STALE) - 1]
        assert np.array_equal(held, before), f"{name} moved while stale"
    figure(UNPLUGGED, WIRES, "noticed after silence began", max(noticed) * 1e3, "ms", 50, real=True)
    figure(UNPLUGGED, WIRES, "back", max(back), "s", 5.5, real=True)
    figure(UNPLUGGED, WIRES, "descriptors leaked", leaked, "", 0)
    assert verified(daemon.path())


@pytest.mark.slow
def test_a_hundred_cycles(tmp_path, figure):
    daemon, _, noticed, back, leaked = cycled(tmp_path, 1, 100)
    figure(
        UNPLUGGED, WIRES, "noticed, worst of 100 cycles", max(noticed) * 1e3, "ms", 50, real=True
    )
    figure(UNPLUGGED, WIRES, "back, worst of 100 cycles", max(back), "s", 5.5, real=True)
    figure(UNPLUGGED, WIRES, "descriptors leaked over 100 cycles", leaked, "", 0)
    assert verified(daemon.path())


def test_garbage_bad_checksum_and_truncated_frames(tmp_path, seed, figure):
    rng = random.Random(seed)
    frames, faults, sent = 2500, 0, 0
    with service(tmp_path) as (wires, daemon):
        encoders = wires.encoders
        for number in range(frames):
            piece = encoders.wire.encode("wheel_encoder", [number], number * 4000)
            if number < frames - 2 and rng.random() < 0.1:
                piece = damage(rng, piece, rng.randrange(len(piece)))
                faults += 1
            encoders.plug.deliver(piece)
            sent += len(piece)
            if number % 4 == 0:
                time.sleep(0.002)
        daemon.wait_status(lambda report: report["devices"]["encoders"]["bytes"] == sent)
        daemon.stop()
    good, bad, garbage = counted(daemon, "frames", "bad", "garbage bytes")
    assert bad + garbage > 0
    figure(
        GARBAGE,
        WIRES,
        "intact frames lost per fault",
        max(0, frames - faults - good) / faults,
        "",
        1,
    )
    assert verified(daemon.path())


def counted(daemon, *names):
    """Counters of the encoders' device, from the daemon's own account."""
    line = [line for _, line in daemon.said if line.startswith("device encoders: ")][-1]
    return [int(re.search(rf"(\d+) {name}", line).group(1)) for name in names]


def another(config, folder, *options):
    """A second daemon on the same devices, with logs of its own: exit code and what it said."""
    done = subprocess.run(
        [sys.executable, "-m", "gritd", "run", "--config", config, "--directory", folder, *options],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def test_two_daemons_on_one_adapter(tmp_path, figure):
    """The second is refused, with the name of the first, which loses nothing."""
    (tmp_path / "wires").mkdir()
    with service(tmp_path / "wires", driven(30.0, 1, skip=1.0), bus="slcan") as (wires, daemon):
        daemon.wait_status(lambda report: report["status"] not in ("STARTING", "STALE"))
        refused = [another(wires.config, tmp_path / str(n)) for n in range(3)]
        wires.finish()
        daemon.wait_status(lambda report: report["queue"]["queued"] == 0)
        lost = wires.bus.lost + wires.encoders.lost
        daemon.stop()

    silent = [said for said in refused if not refuses(*said, daemon.pid)]
    assert not silent, silent
    bad, gone = counted(daemon, "bad", "lost")
    bus = [line for _, line in daemon.said if line.startswith("device bus: ")][-1]
    for words in ("bad", "lost"):
        lost += int(re.search(rf"(\d+) {words}", bus).group(1))
    figure(
        SHARED, WIRES, "second daemons not refused with the name of the first", len(silent), limit=0
    )
    figure(SHARED, WIRES, "frames of the first that were lost", lost + bad + gone, "", 0)
    assert verified(daemon.path())


def refuses(code, said, holder):
    """One line that names who has the port."""
    return code == 1 and said.count("\n") == 1 and f"in use by process {holder} (" in said
