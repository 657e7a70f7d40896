"""`gritd replay`: the same bits again, or a new answer with a new configuration."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import groupby
from pathlib import Path

import pytest

from config import packaged
from estimator.config import load
from estimator.daemon import TICK_TOPIC, TOPICS
from estimator.pipeline import Pipeline
from estimator.recording import RunInfo, RunWriter
from estimator.salvage import read
from tests.linear_plant import readings
from tools import replay
from tools.command import CommandError

ROOT = Path(__file__).parents[1]
TRUTH = (720.0, 0.62, 0.025)
SCHEDULE = [(3.0, 50.0, 0.2), (3.0, 90.0, 0.4)]


@pytest.fixture(scope="module")
def configuration():
    return load(packaged())


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, configuration):
    """A run logged as the daemon logs it: the readings a tick consumed, then the tick."""
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    pipeline = Pipeline(configuration.settings)
    state = pipeline.start()
    writer = RunWriter(path, TOPICS, configuration.text, RunInfo(name="test"))
    sent = 0
    for _, batch in readings(configuration.settings, TRUTH, SCHEDULE, seed=4, rate=250):
        for stamp, group in groupby(batch, key=lambda reading: reading.stamp):
            consumed = list(group)
            state, tick = pipeline.step(state, consumed, stamp)
            for reading in consumed:
                writer.reading(reading)
            writer.message(TICK_TOPIC.name, stamp, tick)
            sent += 1
            if sent % 50 == 0:
                writer.flush()
    writer.close()
    return path


def test_a_replay_is_identical_bit_for_bit(recorded, capsys):
    for _ in range(3):
        assert replay.main([str(recorded), "--verify"]) == 0
    assert "identical bit for bit" in capsys.readouterr().out


@pytest.mark.parametrize("seed", ["0", "1", "4242"])
def test_a_replay_does_not_depend_on_hash_order(recorded, seed):
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    done = subprocess.run(
        [sys.executable, "-m", "tools.cli", "replay", str(recorded), "--verify"],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "identical bit for bit" in done.stdout


def test_a_difference_is_named(recorded, tmp_path, capsys, configuration):
    """One reading changed by a hair is found, with tick and field."""
    changed = tmp_path / "changed.mcap"
    recording = read(recorded)
    writer = RunWriter(changed, TOPICS, configuration.text, recording.run)
    touched = False
    for topic, log_time, values in recording.messages():
        if topic == "/raw/motor_shunt" and not touched and log_time > recording.arrays("/tick")["stamp"][40]:
            values, touched = (values[0], values[1] + 1e-12), True
        writer.message(topic, log_time, values)
    writer.close()
    assert replay.main([str(changed), "--verify"]) == 1
    assert "ticks differ" in (said := capsys.readouterr().out) and "current: logged" in said


def test_a_new_configuration_recomputes_from_the_raw_readings(recorded, tmp_path, capsys):
    text = packaged().read_text().replace("value: 2.0 N*m/A", "value: 2.2 N*m/A")
    other = tmp_path / "other.yaml"
    other.write_text(text)
    out = tmp_path / "out.mcap"
    assert replay.main([str(recorded), "--config", str(other), "-o", str(out)]) == 0
    old, new = read(recorded).arrays("/tick"), read(out).arrays("/tick")
    assert new["torque"][-1] == pytest.approx(1.1 * old["torque"][-1])
    assert new["cohesion"][-1] != old["cohesion"][-1]
    assert replay.main([str(out), "--verify"]) == 0
    capsys.readouterr()


def test_a_cut_recording_is_replayed_and_said_to_be_damaged(recorded, tmp_path, capsys):
    cut = tmp_path / "cut.mcap"
    whole = recorded.read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    assert replay.main([str(cut), "--verify"]) == 3
    captured = capsys.readouterr()
    assert "identical bit for bit" in captured.out and "cut.mcap" in captured.err


def test_raw_readings_alone_are_enough(recorded, tmp_path, capsys, configuration):
    raw = tmp_path / "raw.mcap"
    writer = RunWriter(raw, (), configuration.text, RunInfo())
    for topic, log_time, values in read(recorded).messages():
        if topic.startswith("/raw/"):
            writer.message(topic, log_time, values)
    writer.close()
    assert replay.main([str(raw), "--engine", "plain"]) == 0
    assert "tan φ" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["missing.mcap"], "missing.mcap"),
        (["--verify", "--engine", "plain", "RECORDED"], "--verify"),
        (["RECORDED", "--config", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_bad_input_is_one_line(recorded, arguments, words):
    arguments = [str(recorded) if a == "RECORDED" else a for a in arguments]
    done = subprocess.run(
        [sys.executable, "-m", "tools.cli", "replay", *arguments], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert words in done.stderr and done.stderr.count("\n") == 1


def test_a_file_that_is_no_recording_is_damaged_input(tmp_path):
    text = tmp_path / "notes.mcap"
    text.write_text("not a recording")
    with pytest.raises(CommandError, match=r"notes\.mcap"):
        replay.main([str(text)])
