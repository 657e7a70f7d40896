"""The process dies while it writes, or the power is cut."""

from __future__ import annotations

import os
import random
import signal
import struct
import subprocess
import sys
import time

import numpy as np
import pytest

from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.salvage import read
from tests.scenarios import killed_writer
from tests.scenarios.recorded import rows, verified
from tests.scenarios.rig import ROOT, WIRES, driven, service

KILLED = "kill -9 while logging"
POWER = "power cut while logging"
KILLS = 500


def test_killed_while_logging(tmp_path, seed, figure):
    rng = random.Random(seed)
    with service(tmp_path, driven(40.0, seed, skip=1.0)) as (_, daemon):
        time.sleep(rng.uniform(1.0, 2.0))
        daemon.wait_status(lambda report: report["log"]["written"] > 1000)
        killed = time.time_ns()
        daemon.signal(signal.SIGKILL)
        daemon.exit_code()
    recording = read(daemon.path())
    assert not recording.closed and not recording.lost
    lost = (killed - rows(daemon.path(), "/tick")["stamp"][-1]) * 1e-9
    figure(KILLED, WIRES, "data lost", lost, "s", 0.25, real=True)
    assert verified(daemon.path())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "kills"), [("logging", KILLS), ("rotating", 150), ("closing", 150)]
)
def test_many_kills(tmp_path, kind, kills, figure):
    """The writer in a process of its own, killed at a random time: in the middle of a run, while a
    part begins every 0.1 s, or within the few milliseconds in which it closes. What was lost counts
    from what had been handed over.
    """
    command = [sys.executable, "-m", killed_writer.__name__, str(tmp_path), kind, str(kills)]
    parent, rng = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT), random.Random(1)
    for _ in range(kills):
        child = int(parent.stdout.readline())
        if kind == "closing":
            assert parent.stdout.readline() == killed_writer.MARK
        time.sleep(rng.uniform(0.0, 0.02) if kind == "closing" else rng.uniform(0.25, 0.7))
        os.kill(child, signal.SIGKILL)
    assert parent.wait() == 0
    found = [survived(tmp_path / f"{name}.mcap", tmp_path / f"{name}.put") for name in range(kills)]
    level, lost = (
        f"writer thread in a process of its own, {kind}",
        [loss for loss in found if loss is not None],
    )
    figure(KILLED, level, f"of {kills} runs not readable", found.count(None), "", 0)
    figure(KILLED, level, "data lost, worst", max(lost), "s", 0.25, real=True)
    figure(KILLED, level, "data lost, 99 %", float(np.quantile(lost, 0.99)), "s", 0.25, real=True)


def survived(path, shared):
    """How much of what had been handed over is missing at the end [s]; None if not all before it is
    there, in order.
    """
    count, last = struct.unpack("<qq", shared.read_bytes())
    if not count:
        return 0.0  # killed before it had begun
    try:
        encoder = np.concatenate([read(part).arrays("/raw/wheel_encoder") for part in parts(path)])
    except RecordingError:
        return None
    whole = (
        np.array_equal(encoder["count"][::5], np.arange(len(encoder) // 5))
        and len(encoder) % 5 == 0
    )
    if not whole or len(encoder) > 5 * (count + 1):
        return None
    return (last - (encoder["stamp"][-1] if len(encoder) else last - 4_000_000 * count)) * 1e-9


def test_power_cut(tmp_path, seed, figure):
    """Cut at 300 random bytes; what is read is always the beginning of what was written."""
    check_cuts(
        tmp_path, seed, figure, lambda size: sorted(random.Random(seed).sample(range(size), 300))
    )


@pytest.mark.slow
def test_power_cut_at_every_byte(tmp_path, figure):
    check_cuts(tmp_path, 1, figure, range)


def check_cuts(folder, seed, figure, places):
    whole = short_recording(folder, seed)
    messages = list(map(repr, read(whole).messages()))
    data, cut = whole.read_bytes(), folder / "cut.mcap"
    wrong, unreadable = 0, 0
    offsets = places(len(data))
    for size in offsets:
        cut.write_bytes(data[:size])
        try:
            found = list(map(repr, read(cut).messages()))
        except RecordingError:
            unreadable += size > 64  # without its header it is no MCAP file
            continue
        wrong += found != messages[: len(found)]
    level = "a daemon's recording, the cut simulated"
    figure(
        POWER,
        level,
        f"wrong results, cut at {'every byte' if len(offsets) == len(data) else '300 bytes'}",
        wrong,
        "",
        0,
    )
    figure(POWER, level, "cuts after the header that cannot be read", unreadable, "", 0)


def short_recording(folder, seed):
    """Of 0.3 s of a daemon without sensors: a few chunks."""
    with service(folder, logging={"flush_interval": "50 ms"}) as (_, daemon):
        time.sleep(0.1 * seed)
        daemon.stop()
    return daemon.path()
