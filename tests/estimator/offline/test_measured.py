"""A recording read back on one time grid is the run that made it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.offline.measured import SENSED, MeasuredRun, measured_run
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.tools.testbed.run_files import write
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import Run, simulate_run, soil_of

CONFIGURATION = config.load(packaged())
SETTINGS = CONFIGURATION.settings
SCHEDULE = Schedule(
    (Segment(3.0, 40.0, 0.2, 0.02), Segment(3.0, 80.0, 0.5, 0.03), Segment(3.0, 80.0, 0.3, -0.02)),
    0.5,
)


@pytest.fixture(scope="module")
def made() -> Run:
    return simulate_run(
        SETTINGS, soil_of(SETTINGS), motion_of(SCHEDULE, SETTINGS.wheel.radius, 250.0), (), seed=3
    )


@pytest.fixture(scope="module")
def found(made: Run, tmp_path_factory: pytest.TempPathFactory) -> MeasuredRun:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    write(path, CONFIGURATION, RunInfo(name="run", pass_number=3, start_position=0.4), made)
    return measured_run(read(path), SETTINGS)


def at(found: MeasuredRun, made: Run, values: object) -> np.ndarray:
    """The truth at the grid."""
    return np.interp(found.motion.time, made.motion.time, np.asarray(values))


def test_motion_is_the_one_driven(found: MeasuredRun, made: Run) -> None:
    speed, travel = (
        at(found, made, made.motion.wheel_speed),
        at(found, made, made.motion.carriage_speed),
    )
    assert (
        np.std(found.motion.wheel_speed - speed) < 2e-3
        and np.std(found.motion.carriage_speed - travel) < 2e-4
    )
    np.testing.assert_allclose(
        found.motion.wheel_angle, at(found, made, made.motion.wheel_angle), atol=3e-3
    )
    np.testing.assert_allclose(found.motion.load, at(found, made, made.motion.load), atol=1.5)
    assert found.motion.pass_number == 3.0 and found.motion.start_position == 0.4


def test_readings_are_calibrated_means(found: MeasuredRun, made: Run) -> None:
    for name, spread in zip(SENSED, (3e-5, 3e-3, 0.2, 0.2, 0.02), strict=True):
        steady = np.abs(np.gradient(found.motion.wheel_speed)) < 1e-3
        error = getattr(found.sensed, name) - at(found, made, getattr(made.response.sensed, name))
        assert np.std(error[steady]) < spread, name
    assert found.channels == frozenset(SENSED)


def test_forward_model_driven_by_it_says_what_was_measured(found: MeasuredRun) -> None:
    said = simulate_arrays(
        SETTINGS.wheel,
        soil_of(SETTINGS),
        found.motion,
        torque_constant=SETTINGS.drive.torque_constant.value,
    )
    driving = np.abs(found.motion.wheel_speed) > 0.1
    assert np.sqrt(np.mean((said.sensed.sinkage - found.sensed.sinkage)[driving] ** 2)) < 3e-4
    assert np.sqrt(np.mean((said.torque - found.sensed.torque)[driving] ** 2)) < 0.05


def test_a_common_origin_puts_runs_on_one_clock(made: Run, tmp_path: Path) -> None:
    write(tmp_path / "run.mcap", CONFIGURATION, RunInfo(), made)
    recording = read(tmp_path / "run.mcap")
    own = measured_run(recording, SETTINGS)
    later = measured_run(recording, SETTINGS, origin=own.origin - 60_000_000_000)
    np.testing.assert_allclose(later.motion.time, own.motion.time + 60.0, atol=1e-6)


def test_without_encoder_or_wrench(tmp_path: Path) -> None:
    writer = RunWriter(tmp_path / "run.mcap", (), CONFIGURATION.text, RunInfo(nominal_load=55.0))
    for i in range(400):
        for name, value in (
            ("wheel_encoder", 10 * i),
            ("carriage_encoder", i),
            ("sinkage_pot", 1.0),
        ):
            writer.reading(Reading(4_000_000 * i, name, value, 4_000_000 * i))
    writer.close()
    run = measured_run(read(tmp_path / "run.mcap"), SETTINGS)
    assert (
        run.channels == {"sinkage"}
        and np.isnan(run.sensed.torque).all()
        and np.all(run.motion.load == 55.0)
    )

    writer = RunWriter(tmp_path / "bare.mcap", (), CONFIGURATION.text, RunInfo())
    writer.close()
    with pytest.raises(
        RecordingError, match=r"bare\.mcap: /raw/wheel_encoder: no readings; expected an encoder"
    ):
        measured_run(read(tmp_path / "bare.mcap"), SETTINGS)
