"""`gritd replay`: the same bits again, or a new answer with a new configuration."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import groupby
from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.config.configuration import load, loads, with_engine
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording import metadata, run_writer
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import TICK_TOPIC, TOPICS
from gritd.tools import main as cli
from gritd.tools.cli.command import CommandError
from gritd.tools.cli.progress import Progress
from gritd.tools.cli.yaml_edit import EditedYaml
from gritd.tools.commands import replay, replay_verify
from gritd.tools.diagnose.explain.apply import set_discrepancy
from tests import forms
from tests.linear_plant import readings

ROOT = Path(__file__).parents[3]
TRUTH = (720.0, 0.62, 0.025)
SCHEDULE = [(3.0, 50.0, 0.2), (3.0, 90.0, 0.4)]


@pytest.fixture(scope="module")
def configuration():
    return load(packaged())


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, configuration):
    return logged(tmp_path_factory.mktemp("run") / "run.mcap", configuration)


def logged(path, configuration):
    """A run logged as the daemon logs it: the readings a tick consumed, then the tick."""
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


def test_a_recording_of_the_former_default_engine_is_verified_with_that_engine(
    configuration, tmp_path, capsys
):
    """The recording states its engine: what the default is today does not matter to it."""
    former = with_engine(configuration, "filterpy")
    path = logged(tmp_path / "former.mcap", former)
    assert "engine: filterpy" in str(read(path).config_yaml)
    assert configuration.settings.filter.engine == "plain"

    assert replay.main([str(path), "--verify"]) == 0
    assert "identical bit for bit" in capsys.readouterr().out


def test_a_replay_with_a_learnt_discrepancy_is_identical_too(tmp_path, capsys, configuration):
    """From the effective text that stands in the recording."""
    document = EditedYaml(configuration.text, "testbed.yaml")
    set_discrepancy(document, forms.form(2), "testbed.yaml")
    path = logged(tmp_path / "run.mcap", loads(document.text(), "testbed.yaml"))
    assert replay.main([str(path), "--verify"]) == 0
    assert "identical bit for bit" in capsys.readouterr().out


@pytest.mark.parametrize("seed", ["0", "4242"])
def test_a_replay_does_not_depend_on_hash_order(recorded, seed):
    environment = {**os.environ, "PYTHONHASHSEED": seed}
    done = subprocess.run(
        [sys.executable, "-m", "gritd", "replay", str(recorded), "--verify"],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=6000,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "identical bit for bit" in done.stdout


@pytest.fixture(autouse=True)
def no_progress(monkeypatch):
    """A slow computer shows it among what else is said."""
    monkeypatch.setattr(Progress, "shown", False)


@pytest.fixture
def several(recorded, tmp_path):
    """Copies of a recording, the second without its end."""
    paths = [tmp_path / f"{name}.mcap" for name in ("first", "second", "third")]
    for path in paths:
        path.write_bytes(recorded.read_bytes())
    paths[1].write_bytes(recorded.read_bytes()[:-5000])
    return list(map(str, paths))


def test_any_number_of_jobs_says_the_same(several, capsys):
    said = []
    for jobs in ("1", "3"):
        code = replay.main([*several, "--jobs", jobs])
        said.append((code, *capsys.readouterr()))
    assert said[0] == said[1]
    assert "second.mcap: was not closed" in said[0][2]
    assert all(name in said[0][1] for name in several)


@pytest.mark.long
def test_an_error_ends_several_jobs_where_it_ends_one(several, tmp_path, capsys):
    """The recordings before it have been told, those after it are not."""
    Path(several[1]).write_bytes(b"no recording")
    arguments = ["replay", *several, "--verify", "--jobs"]
    codes, said = [], []
    for jobs in ("1", "3"):
        codes.append(cli.main([*arguments, jobs]))
        said.append(capsys.readouterr())
    assert codes[0] == codes[1] != 0
    assert said[0] == said[1]
    assert "first.mcap" in said[0].out and "third.mcap" not in said[0].out


def test_several_jobs_write_what_one_writes(several, tmp_path):
    for jobs in ("1", "3"):
        (tmp_path / jobs).mkdir()
        replay.main([*several, "--output", str(tmp_path / jobs), "--jobs", jobs])
    for name in map(Path, several):
        one, many = ((tmp_path / jobs / name.name).read_bytes() for jobs in ("1", "3"))
        assert one == many


def test_what_depends_on_the_processor_is_said(configuration):
    assert replay_verify.by_processor(configuration) == ""
    assert "filterpy" in replay_verify.by_processor(with_engine(configuration, "filterpy"))


def test_a_difference_is_named(recorded, tmp_path, capsys, configuration):
    """One reading changed by a hair is found, with tick and field."""
    changed = tmp_path / "changed.mcap"
    recording = read(recorded)
    writer = RunWriter(changed, TOPICS, configuration.text, recording.run)
    touched = False

    for topic, log_time, values in recording.messages():
        if (
            topic == "/raw/motor_shunt"
            and not touched
            and log_time > recording.arrays("/tick")["stamp"][40]
        ):
            values, touched = (values[0], values[1] + 1e-12), True
        writer.message(topic, log_time, values)

    writer.close()
    assert replay.main([str(changed), "--verify"]) == 1
    assert "ticks differ" in (said := capsys.readouterr().out) and "current: logged" in said
    assert "processor" not in said and "computed by" not in said


def test_a_difference_names_what_computed_otherwise(recorded, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(replay_verify.Differences, "compare", lambda self, *_: _differs(self))
    monkeypatch.setattr(metadata, "versions", lambda: {"python": "3.99.0", "numpy": "9.9"})
    assert replay.main([str(recorded), "--verify"]) == 1
    said = capsys.readouterr().out
    assert "python 3.99.0, then" in said and "numpy 9.9, then" in said


def _differs(differences):
    differences.compared += 1
    differences.ticks += 1


def test_a_recording_of_another_revision_is_not_compared(recorded, tmp_path, monkeypatch, capsys):
    """Made by gritd before the filter computed another /tick: one line says so."""
    for written, found in (("7", "7"), ("", "1")):
        monkeypatch.setattr(run_writer, "REVISION", written)
        if not written:
            monkeypatch.setattr(run_writer, "TICK_REVISION", "some_other_entry")
        old = tmp_path / f"old{written}.mcap"
        writer = RunWriter(old, TOPICS, read(recorded).config_yaml, RunInfo())
        for topic, log_time, values in read(recorded).messages():
            writer.message(topic, log_time, values)
        writer.close()

        with pytest.raises(CommandError) as refused:
            replay.main([str(old), "--verify"])
        words = f"{old}: its /tick was computed by revision {found} of the filter"
        assert refused.value.code == 2 and str(refused.value).startswith(words)
        assert "recompute without --verify" in str(refused.value)
        assert replay.main([str(old)]) == 0, "and can be recomputed"
    capsys.readouterr()


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
        [sys.executable, "-m", "gritd", "replay", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 2
    assert words in done.stderr and done.stderr.count("\n") == 1


def test_a_file_that_is_no_recording_is_damaged_input(tmp_path):
    text = tmp_path / "notes.mcap"
    text.write_text("not a recording")
    with pytest.raises(CommandError, match=r"notes\.mcap"):
        replay.main([str(text)])


@pytest.mark.parametrize("output", ["the input", "nowhere/x.mcap", "taken.mcap", "its folder"])
def test_an_output_that_cannot_be_made_is_refused_before_the_replay(
    recorded, tmp_path, output, capsys
):
    (tmp_path / "taken.mcap").write_bytes(b"mine")
    before = recorded.read_bytes()
    target = {"the input": recorded, "its folder": recorded.parent}.get(output, tmp_path / output)

    assert cli.main(["replay", str(recorded), "-o", str(target)]) == 2

    said = capsys.readouterr()
    assert (
        said.out == ""
        and said.err.count("\n") == 1
        and str(target) in said.err
        and "expected" in said.err
    )
    assert recorded.read_bytes() == before and (tmp_path / "taken.mcap").read_bytes() == b"mine"


def test_missing_is_usage_and_no_recording_is_damage_wherever_it_stands(recorded, tmp_path, capsys):
    (tmp_path / "photo.png").write_bytes(b"\x89PNG" + bytes(500))
    for name, code in (("none.mcap", 2), (".", 3), ("photo.png", 3)):
        for files in ([tmp_path / name], [recorded, tmp_path / name]):
            assert cli.main(["replay", *map(str, files), "--engine", "plain"]) == code
            said = capsys.readouterr().err
            assert said.startswith(f"gritd: {tmp_path / name}") and said.count("\n") == 1


def test_a_folder_is_no_recording_however_it_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in ("replay", "recover"):
        assert cli.main([command, "."]) == 3
        said = capsys.readouterr().err
        assert said.startswith("gritd: .: ") and "internal error" not in said


def test_missing_messages_are_counted_and_no_difference(recorded, tmp_path, capsys):
    """After a gap the state is not known: what stands before it is compared, the rest is not."""
    damaged, mended = tmp_path / "damaged.mcap", tmp_path / "mended.mcap"
    data = bytearray(recorded.read_bytes())
    data[data.index(b"\x28\xb5\x2f\xfd", len(data) // 2) + 100] ^= 1  # inside a zstd frame
    damaged.write_bytes(data)
    assert cli.main(["recover", str(damaged), "-o", str(mended)]) == 3

    for path in (damaged, mended):
        assert cli.main(["replay", str(path), "--verify"]) == 3
        said = capsys.readouterr().out
        lost = sum(read(recorded).counts.values()) - sum(read(mended).counts.values())
        assert f"{path}: {lost} messages are missing" in said
        assert "identical bit for bit; " in said and "not comparable" in said
        assert "differ" not in said


def test_another_engine_stands_in_the_recording_it_made(recorded, tmp_path, capsys):
    out = tmp_path / "filterpy.mcap"
    assert replay.main([str(recorded), "--engine", "filterpy", "-o", str(out)]) == 0
    assert "engine: filterpy" in str(read(out).config_yaml)
    assert replay.main([str(out), "--verify"]) == 0
    assert "identical bit for bit" in capsys.readouterr().out


def test_a_replay_with_the_configuration_of_another_wheel_is_refused(recorded, tmp_path, capsys):
    other = tmp_path / "other.yaml"
    other.write_text(packaged().read_text().replace("radius: 72 mm", "radius: 90 mm"))
    (tmp_path / "testbed.dbc").write_bytes(packaged("testbed.dbc").read_bytes())
    command = ["replay", str(recorded), "--config", str(other)]

    assert cli.main(command) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "wheel.radius 0.072 (configuration: 0.09)" in said

    assert cli.main([*command, "--other-rig"]) == 0
