"""The MGST importer against what the data's authors report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.tools.commands.import_rig import main
from tests.real_recordings import REAL, Physical, needs

pytestmark = needs("mgst")

TRIALS = {20: ("165209", "165752", "170905"), 70: ("171441", "172203", "172636")}
RADIUS, TORQUE_PER_AMPERE = 0.075, 6.2


def run(output: Path, *options: str) -> Path:
    assert main(["mgst", str(REAL / "mgst"), "-o", str(output), *options]) == 0
    return output


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(tmp_path_factory.mktemp("mgst"))


@pytest.fixture(scope="module")
def concealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = ("--conceal", "torque", "--conceal", "lateral_force", "--drawbar-pull", "raw")
    return run(tmp_path_factory.mktemp("concealed"), *options)


def trials(folder: Path) -> dict[str, Physical]:
    return {path.stem: Physical(path) for path in sorted(folder.glob("*.mcap"))}


def test_six_trials_and_one_configuration(imported: Path) -> None:
    names = {f"mgst-{slip}-{time}.mcap" for slip, times in TRIALS.items() for time in times}
    assert {path.name for path in imported.iterdir()} == names | {"mgst.yaml"}


def test_slip_is_the_one_that_was_imposed(imported: Path) -> None:
    for name, trial in trials(imported).items():
        rim = RADIUS * trial.speed("wheel_encoder", 3.0, 14.0)
        assert rim / RADIUS == pytest.approx(0.462, rel=0.003)
        slip = 1.0 - trial.speed("carriage_encoder", 3.0, 14.0) * trial.settings.pulley_radius / rim
        assert slip == pytest.approx(int(name[5:7]) / 100, abs=0.003)


def test_motor_torque_exceeds_the_axle_torque_by_what_the_drivetrain_consumes(
    imported: Path,
) -> None:
    losses = []
    for trial in trials(imported).values():
        steady = trial.time("motor_shunt") > 3.0
        axle = trial.force("ty")[trial.time("wrench") > 3.0]
        assert axle.mean() > 4.0, "positive when driving"
        losses.append(TORQUE_PER_AMPERE * trial.value("motor_shunt")[steady].mean() - axle.mean())
    assert np.sort(losses)[:5] == pytest.approx(1.78, abs=0.1)
    assert max(losses) == pytest.approx(2.25, abs=0.1)


def test_sinkage_starts_at_the_static_one_and_grows_with_slip(imported: Path) -> None:
    deepest = {}
    for name, trial in trials(imported).items():
        z = np.convolve(trial.value("sinkage_pot"), np.ones(20) / 20, "valid")
        assert z[0] == pytest.approx(0.020, abs=1.5e-3)
        deepest[name] = z.max() - 0.020
    assert all(2.5e-3 < z < 7e-3 for name, z in deepest.items() if name.startswith("mgst-20"))
    assert all(11e-3 < z < 16e-3 for name, z in deepest.items() if name.startswith("mgst-70"))


def test_load_is_what_the_vertical_axis_leaves_of_the_weights(imported: Path) -> None:
    for trial in trials(imported).values():
        assert 150.0 < trial.force("fz").min() < trial.force("fz").max() < 190.0
        assert trial.recording.run.nominal_load == pytest.approx(trial.force("fz").mean(), abs=1.0)


def test_a_recording_begins_with_the_start_of_the_wheel_and_ends_with_the_shorter_log(
    imported: Path,
) -> None:
    for trial in trials(imported).values():
        assert trial.speed("wheel_encoder", 0.0, 0.1) < 0.1 * trial.speed(
            "wheel_encoder", 5.0, 10.0
        )
        for channel in (
            "wheel_encoder",
            "carriage_encoder",
            "sinkage_pot",
            "motor_shunt",
            "wrench",
        ):
            time = trial.time(channel)
            assert time[0] < 0.02 or (channel == "wrench" and 0.4 < time[0] < 0.7)
            assert time[-1] == pytest.approx(15.1, abs=0.2)


def test_concealed_axes_are_gone_and_said_to_be_unknown(imported: Path, concealed: Path) -> None:
    for name, trial in trials(concealed).items():
        whole = Physical(imported / f"{name}.mcap")
        assert not trial.force("ty").any() and not trial.force("fy").any()
        assert trial.settings.wrench is not None and whole.settings.wrench is not None
        assert trial.settings.wrench.torque.offset.sigma == 1e6
        assert whole.settings.wrench.torque.offset.sigma < 1.0
        assert "concealed: lateral_force, torque" in trial.recording.run.notes
        np.testing.assert_array_equal(trial.value("motor_shunt"), whole.value("motor_shunt"))
        np.testing.assert_array_equal(trial.force("fz"), whole.force("fz"))


def test_raw_drawbar_pull_lacks_a_quarter_of_the_lateral_force(
    imported: Path, concealed: Path
) -> None:
    for name, trial in trials(concealed).items():
        whole = Physical(imported / f"{name}.mcap")
        np.testing.assert_allclose(
            trial.force("fx") + 0.25 * whole.force("fy"), whole.force("fx"), atol=1e-9
        )


def test_a_concealed_sensor_is_not_in_the_recording(tmp_path: Path) -> None:
    for path in run(tmp_path, "--conceal", "motor_shunt").glob("*.mcap"):
        trial = Physical(path)
        assert len(trial.time("motor_shunt")) == 0
        assert len(trial.time("sinkage_pot")) > 1000


def test_importing_again_gives_the_same_bytes_and_replaces_what_was_there(
    imported: Path, tmp_path: Path
) -> None:
    (tmp_path / "mgst-20-165209.mcap").write_bytes(b"an earlier import")
    run(tmp_path)
    for path in imported.iterdir():
        assert path.read_bytes() == (tmp_path / path.name).read_bytes()
