"""The motion read back from a recording is the one that made it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.offline import recorded_motion as module
from gritd.estimator.offline.recorded_motion import recorded_motion
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.stages.situation import Motion
from gritd.tools.commands.simulate import SimulatedRun, simulate_run, soil_of, write
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of

CONFIGURATION = config.load(packaged())
SETTINGS = CONFIGURATION.settings
RATE = 250.0
SCHEDULE = Schedule(
    (Segment(3.0, 40.0, 0.2, 0.02), Segment(3.0, 80.0, 0.5, 0.03), Segment(3.0, 80.0, 0.3, -0.02)),
    0.5,
)


@pytest.fixture(scope="module")
def made() -> SimulatedRun:
    return simulate_run(
        SETTINGS, soil_of(SETTINGS), motion_of(SCHEDULE, SETTINGS.wheel.radius, RATE), (), seed=3
    )


@pytest.fixture(scope="module")
def recording(made: SimulatedRun, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    write(path, CONFIGURATION, RunInfo(name="run", pass_number=3, start_position=0.4), made)
    return read(path)


@pytest.fixture(scope="module")
def motion(recording: Recording) -> Motion:
    return recorded_motion(recording, SETTINGS, RATE)


def at(motion: Motion, made: SimulatedRun, values: object) -> np.ndarray:
    """The truth at the centres of the windows."""
    return np.interp(motion.time, made.motion.time, np.asarray(values))


def test_motion_is_the_one_driven(motion: Motion, made: SimulatedRun) -> None:
    for name, spread in (
        ("wheel_angle", 1e-3), ("wheel_speed", 2e-3), ("carriage_speed", 2e-4), ("load", 1.5),
    ):  # fmt: skip
        error = getattr(motion, name) - at(motion, made, getattr(made.motion, name))
        assert np.std(error) < spread, name
    half_full = 0.5 / SETTINGS.rates.update
    assert motion.time[0] == pytest.approx(half_full, abs=4e-3)
    assert motion.carriage_position[0] == 0.0
    assert np.ptp(np.diff(motion.time)) < 1e-9 and 8.8 < motion.time[-1] < 9.0
    assert motion.pass_number == 3.0 and motion.start_position == 0.4


def test_forward_model_driven_by_it_says_what_was_felt(motion: Motion, made: SimulatedRun) -> None:
    again = simulate_arrays(
        SETTINGS.wheel,
        soil_of(SETTINGS),
        motion,
        torque_constant=SETTINGS.drive.torque_constant.value,
    )
    driving = np.abs(motion.wheel_speed) > 0.1
    sinkage = again.sensed.sinkage - at(motion, made, made.response.sensed.sinkage)
    torque = again.torque - at(motion, made, made.response.torque)
    assert np.sqrt(np.mean(sinkage[driving] ** 2)) < 3e-4
    assert np.sqrt(np.mean(torque[driving] ** 2)) < 0.05


def test_pieces_looked_at_one_by_one_give_the_same(recording, motion, monkeypatch) -> None:
    monkeypatch.setattr(module, "AT_ONCE", 333)
    pieces = recorded_motion(recording, SETTINGS, RATE)
    for name in ("time", "wheel_angle", "wheel_speed", "carriage_speed", "load"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(motion, name))


def steady(path: Path, run: RunInfo, silent: range = range(0)) -> Recording:
    """Both encoders at a steady speed for four seconds, without the instants that are silent."""
    writer = RunWriter(path, (), CONFIGURATION.text, run)
    for i in sorted(set(range(1000)) - set(silent)):
        for name, value in (("wheel_encoder", 10 * i), ("carriage_encoder", i)):
            writer.reading(Reading(4_000_000 * i, name, value, 4_000_000 * i))
    writer.close()
    return read(path)


def test_through_a_silence_the_motion_goes_on_evenly(tmp_path: Path) -> None:
    whole = recorded_motion(steady(tmp_path / "a.mcap", RunInfo()), SETTINGS, RATE)
    holed = recorded_motion(steady(tmp_path / "b.mcap", RunInfo(), range(400, 600)), SETTINGS, RATE)
    np.testing.assert_allclose(holed.wheel_angle, whole.wheel_angle, atol=0.3 * 0.05)
    np.testing.assert_allclose(holed.wheel_speed, whole.wheel_speed, rtol=1e-9)
    assert whole.wheel_speed[0] == pytest.approx(10 * 0.0958738e-3 * RATE)


@pytest.mark.parametrize(("stated", "load"), [(55.0, 55.0), (None, 70.0)])
def test_without_a_wrench_the_load_is_the_runs_or_the_configured_one(
    tmp_path: Path, stated: float | None, load: float
) -> None:
    recording = steady(tmp_path / "run.mcap", RunInfo(nominal_load=stated))
    for settings in (SETTINGS, replace(SETTINGS, wrench=None)):
        assert np.all(recorded_motion(recording, settings, RATE).load == load)


def test_a_recording_without_motion_is_one_line(tmp_path: Path) -> None:
    RunWriter(tmp_path / "bare.mcap", (), CONFIGURATION.text, RunInfo()).close()
    with pytest.raises(
        RecordingError, match=r"bare\.mcap: /raw/wheel_encoder: no readings; expected an encoder"
    ):
        recorded_motion(read(tmp_path / "bare.mcap"), SETTINGS, RATE)
    short = steady(tmp_path / "short.mcap", RunInfo(), range(5, 1000))
    with pytest.raises(
        RecordingError, match=r"short\.mcap: channels overlap for less than a window"
    ):
        recorded_motion(short, SETTINGS, RATE)
