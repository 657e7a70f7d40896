"""The raw bytes of every device, kept by `gritd run --tap` and played again by `--from-tap`."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest

from gritd.estimator.messages.readings import CHANNELS
from gritd.estimator.recording.salvage import read
from tests.scenarios.recorded import verified
from tests.scenarios.rig import ROOT, DaemonProcess, Wires, driven

pytestmark = pytest.mark.long

BUSES = ("slcan", "udp_multicast")


def kept(folder, bus, unplugged=False):
    """The recording of a run on wires, whose bytes are in folder/wires."""
    with (
        Wires(folder, bus=bus) as wires,
        DaemonProcess(wires.config, "--tap", str(folder / "wires"), "--name", "live") as daemon,
    ):
        daemon.ready()
        wires.play(driven(40.0, 1, skip=1.0))
        time.sleep(2.0)
        if unplugged:
            wires.encoders.plug.unplug()
            time.sleep(0.3)
            wires.encoders.plug.plug_in()
            time.sleep(1.5)
        daemon.stop()
    assert "tap: " in daemon.text and str(folder / "wires" / "encoders.wire") in daemon.text
    return read(daemon.path()), wires.config


def gritd(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "gritd", *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip


def played(folder, config, *arguments):
    """The recording that wire logs give when they are played."""
    out = folder / f"again{'-'.join(arguments)}"
    done = gritd(
        "run", "--config", config, "--from-tap", folder / "wires", "--directory", out, *arguments
    )
    assert done.returncode == 0, done.stderr
    (path,) = out.glob("*.mcap")
    return read(path), done.stdout


def raw(recording, channel):
    """Readings in the order they were received."""
    rows = recording.arrays(f"/raw/{channel}")
    names = [name for name in rows.dtype.names if name != "order"]
    return rows[names][np.argsort(rows["log_time"], kind="stable")]


@pytest.mark.parametrize("bus", BUSES)
def test_played_at_once_the_drivers_say_the_same_to_the_bit(tmp_path, bus):
    live, config = kept(tmp_path, bus, unplugged=bus == "slcan")
    again, said = played(tmp_path, config, "--fast")

    for channel in CHANNELS:
        there, here = raw(live, channel), raw(again, channel)
        assert len(there) and np.array_equal(there, here), channel
    assert again.complete and verified(again.path)
    total = sum(again.counts[f"/raw/{channel}"] for channel in CHANNELS)
    assert f": {total} readings, {again.counts['/tick']} ticks; encoders" in said

    twice, _ = played(tmp_path / ".", config, "--fast", "--name", "twice")
    assert twice.arrays("/tick").tobytes() == again.arrays("/tick").tobytes()


def test_played_in_real_time_the_daemon_reads_it_and_ends_by_itself(tmp_path):
    live, config = kept(tmp_path, "slcan")
    began = time.monotonic()
    again, said = played(tmp_path, config, "--status", "0")
    received = live.arrays("/raw/wheel_encoder")["log_time"]
    assert time.monotonic() - began > 1e-9 * np.ptp(received)

    for channel in CHANNELS:
        there, here = raw(live, channel), raw(again, channel)
        (shift,) = set((here["log_time"] - there["log_time"]).tolist())
        assert np.array_equal(there["stamp"] + shift, here["stamp"]), channel
        for name in there.dtype.names[2:]:
            assert np.array_equal(there[name], here[name], equal_nan=True), (channel, name)
    assert again.complete and verified(again.path)
    assert "log closed" in said and " dropped 0 " in said


def test_what_cannot_be_played_or_kept_is_one_line(tmp_path):
    with Wires(tmp_path) as wires:
        config = wires.config
    (tmp_path / "wires").mkdir()
    for arguments, said in (
        (("--from-tap", tmp_path / "none"), "none/encoders.wire: No such file or directory"),
        (("--from-tap", tmp_path / "none", "--fast"), "encoders.wire: No such file or directory"),
        (("--tap", config), f"{config}: file exists"),
        (("--fast",), "argument --fast: only with --from-tap"),
        (("--tap", "a", "--from-tap", "b"), "argument --from-tap: not allowed with argument --tap"),
    ):
        done = gritd("run", "--config", config, "--directory", tmp_path / "log", *arguments)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
        assert said in done.stderr and not list(tmp_path.glob("log/*.mcap"))

    for name in ("encoders", "bus"):
        (tmp_path / "wires" / f"{name}.wire").write_bytes(b"gritd wire 1\n")
    for arguments, code, said in (
        (("--from-tap", tmp_path / "wires", "--fast"), 3, "the wire logs hold no readings"),
        (("--tap", tmp_path / "wires"), 2, "encoders.wire: File exists"),
    ):
        done = gritd("run", "--config", config, "--directory", tmp_path / "log", *arguments)
        assert done.returncode == code and done.stderr.count("\n") == 1, done.stderr
        assert said in done.stderr
