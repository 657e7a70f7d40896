"""Recordings that are hostile, huge or damaged."""

from __future__ import annotations

import os
import random

import pytest

from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import DAMAGED, DONE
from gritd.tools.commands import recover
from tests.estimator.recording.hostile import HOSTILE, probe
from tests.estimator.recording.samples import write_sample
from tests.scenarios.rig import driven, service

HUGE = "hostile or huge recording"
FLIPPED = "recording with flipped bits"
OWN = "reader in a process of its own"


@pytest.mark.parametrize("name", sorted(HOSTILE))
def test_hostile_recording(tmp_path, name, figure):
    (tmp_path / "a.mcap").write_bytes(HOSTILE[name]())
    check(tmp_path / "a.mcap", figure)


def test_sparse_ten_gigabytes(tmp_path, figure):
    write_sample(tmp_path / "a.mcap", 10, close=False)
    os.truncate(tmp_path / "a.mcap", 10 << 30)
    check(tmp_path / "a.mcap", figure)


def check(path, figure):
    """Time on a busy machine says nothing: it is stated, and held to ten times its limit."""
    seconds, memory, said = probe(path)
    assert "\n" not in said.strip()
    figure(HUGE, OWN, "memory", memory, "MB", 256)
    figure(
        HUGE, OWN, "processor time to the error, with Python's start", seconds, "s", 2, real=True
    )


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Two seconds of a daemon's recording."""
    folder = tmp_path_factory.mktemp("original")
    with service(folder, driven(40.0, 1, skip=2.0)) as (_, daemon):
        daemon.wait_status(lambda report: report["loop"]["ticks"] > 500)
        daemon.stop()
    return daemon.path()


def test_flipped_bits(original, tmp_path, seed, figure):
    """40 copies with up to ten flipped bits: nothing is returned that was not written, and the
    exit code says so.
    """
    rng = random.Random(seed)
    data, written = original.read_bytes(), set(map(repr, read(original).messages()))
    wrong, silent = 0, 0
    for number in range(40):
        path = flipped(tmp_path / f"{number}.mcap", data, rng)
        try:
            recording = read(path)
        except RecordingError:
            continue
        found = [repr(message) for message in recording.messages()]
        wrong += sum(message not in written for message in found)
        silent += len(found) < len(written) and not recording.damage
    figure(
        FLIPPED, "a daemon's recording, flips simulated", "wrong messages returned", wrong, "", 0
    )
    figure(FLIPPED, "a daemon's recording, flips simulated", "losses not reported", silent, "", 0)


def flipped(path, data, rng):
    damaged = bytearray(data)
    for _ in range(rng.randrange(1, 11)):
        damaged[rng.randrange(100, len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(damaged)
    return path


def test_a_lossy_recording_is_code_3(original, tmp_path, seed):
    data = bytearray(original.read_bytes())
    data[len(data) // 2] ^= 1 << seed
    (tmp_path / "a.mcap").write_bytes(data)
    code = recover.main([str(tmp_path / "a.mcap"), "-o", str(tmp_path / "b.mcap")])
    lossy = not read(tmp_path / "a.mcap").saved
    assert code == (DAMAGED if lossy else DONE)
