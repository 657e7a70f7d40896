"""A state written as text and read back goes on to the same bits; a reloaded configuration is part
of the recording.
"""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import groupby

import pytest

from gritd.config import packaged
from gritd.estimator.config.configuration import load, loads
from gritd.estimator.config.settings import Uncertain
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online import checkpoint
from gritd.estimator.online.carry import carry_over, needs_restart
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.parts import part_path
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.topics import CHECKPOINT_TOPIC, TICK_TOPIC, TOPICS
from gritd.tools.commands import replay
from tests.linear_plant import readings

TESTBED = load(packaged())
SETTINGS = TESTBED.settings
TRUTH = (720.0, 0.62, 0.025)
SCHEDULE = [(2.0, 50.0, 0.2), (2.0, 90.0, 0.4)]


@pytest.fixture(scope="module")
def consumed():
    """(stamp, readings) of every tick."""
    batches = [
        b for _, batch in readings(SETTINGS, TRUTH, SCHEDULE, seed=4, rate=250) for b in batch
    ]
    return [
        (stamp, list(group)) for stamp, group in groupby(batches, key=lambda reading: reading.stamp)
    ]


def run(pipeline, state, ticks):
    records = []
    for stamp, consumed in ticks:
        state, record = pipeline.step(state, consumed, stamp)
        records.append(TICK_TOPIC.codec.encode(record))
    return state, records


@pytest.mark.parametrize("at", [0, 3, 40, 333, 700])
def test_a_state_read_back_goes_on_to_the_same_bits(consumed, at):
    pipeline = Pipeline(SETTINGS)
    state, _ = run(pipeline, pipeline.start(), consumed[:at])
    text = checkpoint.encode(state)
    restored = checkpoint.decode(text, pipeline.settings)
    assert checkpoint.encode(restored) == text
    assert run(pipeline, restored, consumed[at:])[1] == run(pipeline, state, consumed[at:])[1]


def test_a_state_of_an_older_version_may_lack_the_last_fields(consumed):
    """Of TrackState `origin`: the place counts from there on; and what a review holds."""
    pipeline = Pipeline(SETTINGS)
    state, _ = run(pipeline, pipeline.start(), consumed[:333])
    parts = json.loads(checkpoint.encode(state))
    (track,) = (
        item["TrackState"]
        for item in parts["rest"]
        if isinstance(item, dict) and "TrackState" in item
    )
    del track[-3:]
    assert track.pop() == state.track.origin
    restored = checkpoint.decode(json.dumps(parts), pipeline.settings)
    assert restored.track == state.track._replace(
        origin=None, task=None, withheld=None, resets_flagged=0
    )
    track += [None, None, None, 0, 1]
    with pytest.raises(ValueError, match="not a state of this configuration"):
        checkpoint.decode(json.dumps(parts), pipeline.settings)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[1]",
        '{"sync":{"dict":{}},"rest":[]}',
        '{"sync":{"os.system":["id"]},"rest":[]}',
        "[" * 100_000,
    ],
)
def test_what_is_no_state_is_one_line(text):
    with pytest.raises(ValueError, match="not a state of this configuration") as error:
        checkpoint.decode(text, SETTINGS)
    assert "\n" not in str(error.value)


def test_a_state_of_other_channels_is_refused(consumed):
    pipeline = Pipeline(replace(SETTINGS, wrench=None))
    text = checkpoint.encode(run(pipeline, pipeline.start(), consumed[:9])[0])
    with pytest.raises(ValueError, match="fz"):
        checkpoint.decode(text, SETTINGS)


def test_an_effects_memory_of_an_older_version_is_refused(consumed):
    """It was one number; now it is a list of them."""
    pipeline = Pipeline(SETTINGS)
    state, _ = run(pipeline, pipeline.start(), consumed[:9])
    older = replace(state, track=state.track._replace(recall={"motor_heating": 0.3}))
    with pytest.raises(ValueError, match=r"TrackState\.recall"):
        checkpoint.decode(checkpoint.encode(older), SETTINGS)


def test_no_class_but_those_of_a_state_can_be_named():
    text = json.dumps({"sync": {"Popen": [["true"]]}, "rest": []})
    with pytest.raises(ValueError, match="KeyError: 'Popen'"):
        checkpoint.decode(text, SETTINGS)


def changed(**sections):
    return replace(SETTINGS, **sections)


def test_a_reload_keeps_the_estimate_unless_the_soil_section_changed(consumed):
    before = Pipeline(SETTINGS)
    state, _ = run(before, before.start(), consumed)
    drive = Pipeline(changed(drive=replace(SETTINGS.drive, torque_constant=Uncertain(2.1, 0.01))))
    kept = carry_over(drive, state, before.settings).track.estimate
    assert kept.x[:3] == pytest.approx(state.track.estimate.x[:3])
    assert kept.soil_P[0][0] == pytest.approx(drive.start().track.estimate.soil_P[0][0])
    soil = Pipeline(changed(soil=replace(SETTINGS.soil, cohesion=Uncertain(500.0, 100.0))))
    assert carry_over(soil, state, before.settings).track.estimate == soil.start().track.estimate


def test_counters_time_and_baselines_go_on_through_a_reload(consumed):
    pipeline = Pipeline(SETTINGS)
    state, _ = run(
        pipeline, pipeline.start(), [*consumed[:300], *consumed[290:300], *consumed[300:]]
    )
    counters = state.sync.counters
    assert counters.late + counters.duplicates > 0
    after = carry_over(Pipeline(SETTINGS), state, pipeline.settings)
    assert after.sync.counters == counters and after.first == state.first
    for name in ("updates", "began", "recall"):
        assert getattr(after.track, name) == getattr(state.track, name), name
    assert after.track.origin == pytest.approx(state.track.origin, rel=1e-12)


def test_the_place_where_the_run_began_is_read_anew_with_the_carriage_calibration(consumed):
    pipeline = Pipeline(SETTINGS)
    moved = [
        (t, [r._replace(value=r.value + 5000) if "carriage" in r.channel else r for r in b])
        for t, b in consumed
    ]
    state, _ = run(pipeline, pipeline.start(), moved[:100])
    channel = SETTINGS.channels["carriage_encoder"]
    larger = replace(
        channel.calibration, scale=Uncertain(channel.calibration.scale.value * 1.01, 0.0)
    )
    other = Pipeline(
        changed(
            channels={**SETTINGS.channels, "carriage_encoder": replace(channel, calibration=larger)}
        )
    )
    after = carry_over(other, state, pipeline.settings)
    assert state.track.origin > 0.05 and after.track.origin == pytest.approx(
        1.01 * state.track.origin
    )


@pytest.mark.parametrize(
    ("section", "value", "key"),
    [
        ("rates", replace(SETTINGS.rates, tick=500.0), "rates"),
        ("devices", {}, "devices"),
        ("wrench", None, "channels"),
        ("logging", replace(SETTINGS.logging, directory="/elsewhere"), "logging.directory"),
    ],
)
def test_what_needs_a_restart_is_named(section, value, key):
    assert needs_restart(SETTINGS, changed(**{section: value})) == key
    assert needs_restart(SETTINGS, SETTINGS) == ""


def test_a_rig_without_a_torque_sensor_takes_over_a_new_calibration():
    plain = changed(wrench=None, drive=replace(SETTINGS.drive, torque_source="motor_shunt"))
    other = replace(plain, drive=replace(plain.drive, torque_constant=Uncertain(2.1, 0.01)))
    assert needs_restart(plain, other) == ""


def test_a_recording_through_a_reload_and_a_loss_is_verified_bit_for_bit(
    consumed, tmp_path, capsys
):
    """What the daemon writes: part 1 with another configuration, part 2 after a loss, its
    checkpoint later.
    """
    other = loads(TESTBED.text.replace("2.0 N*m/A", "2.1 N*m/A"), "other", None)
    assert other.settings.drive != SETTINGS.drive
    path = tmp_path / "run.mcap"
    first, second = Pipeline(SETTINGS), Pipeline(other.settings)
    state = write(path, 0, 0, TESTBED.text, first, first.start(), consumed[:300], None)
    state = carry_over(second, state, first.settings)
    state = write(path, 1, 0, other.text, second, state, consumed[300:600], 0)
    state, _ = run(second, state, consumed[600:700])  # these are lost
    write(path, 2, 2000, other.text, second, state, consumed[700:], 50)
    assert replay.main([str(path), "--verify"]) == 0
    out = capsys.readouterr().out
    assert (
        f"{len(consumed) - 150} ticks" in out
        and "50 more after lost messages not comparable" in out
    )
    for part in (1, 2):
        assert replay.main([str(part_path(path, part)), "--verify"]) == 0


def test_a_wrong_checkpoint_is_found(consumed, tmp_path, capsys):
    path = tmp_path / "run.mcap"
    pipeline = Pipeline(SETTINGS)
    write(path, 0, 0, TESTBED.text, pipeline, pipeline.start(), consumed[:300], None)
    write(
        path, 1, 0, TESTBED.text, pipeline, pipeline.start(), consumed[300:], 0
    )  # the prior: not what part 0 led to
    assert replay.main([str(path), "--verify"]) == 1
    assert "not the state that the ticks before it lead to" in capsys.readouterr().out


def write(path, part, lost, text, pipeline, state, ticks, checkpoint_at):
    """One part of a run as the daemon writes it; the state after it."""
    writer = RunWriter(
        part_path(path, part), TOPICS, text, RunInfo("r", part=part, lost_before=lost)
    )
    for number, (stamp, batch) in enumerate(ticks):
        if number == checkpoint_at:
            writer.message(CHECKPOINT_TOPIC.name, stamp, (stamp, text, checkpoint.encode(state)))
        state, record = pipeline.step(state, batch, stamp)
        for reading in batch:
            writer.reading(reading)
        writer.message(TICK_TOPIC.name, stamp, record)
    writer.close()
    return state
