"""Ding's points and the EMPS drive, imported and read back."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from gritd.tools.commands.import_rig import main
from tests.real.data import REAL, Physical, needs


@needs("ding")
def test_every_point_of_the_table_is_a_segment(tmp_path: Path) -> None:
    assert main(["table", str(REAL / "ding"), "-o", str(tmp_path)]) == 0
    trial = Physical(tmp_path / "ding2011_smooth.mcap")
    torque = trial.value("motor_shunt") * trial.settings.drive.torque_constant.value
    found = []

    for begin in np.arange(6) * 7.0:
        inside = (trial.time("motor_shunt") >= begin) & (trial.time("motor_shunt") < begin + 6.0)
        rim = trial.settings.wheel.radius * trial.speed("wheel_encoder", begin, begin + 6.0)
        slip = 1.0 - trial.speed("carriage_encoder", begin, begin + 6.0) / rim
        found.append((slip, trial.force("fx")[inside].mean(), torque[inside].mean()))
        assert trial.force("fz")[inside] == pytest.approx(80.0)

    with (REAL / "ding" / "ding2011_smooth.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    columns = ("slip", "meas_drawbar_pull_n", "meas_torque_nm")
    np.testing.assert_allclose(
        found, [[float(row[name]) for name in columns] for row in rows], atol=1e-3
    )


@needs("ding")
def test_the_soils_strength_is_hidden_unless_asked_for(tmp_path: Path) -> None:
    for strength, cohesion, tan_phi in (
        ("unknown", 500.0, 0.6),
        ("table", 250.0, np.tan(np.radians(31.9))),
    ):
        output = tmp_path / strength
        assert (
            main(["table", str(REAL / "ding"), "-o", str(output), "--soil-strength", strength]) == 0
        )
        soil = Physical(output / "ding2011_smooth.mcap").settings.soil
        assert (soil.cohesion.value, soil.tan_phi.value) == pytest.approx(
            (cohesion, tan_phi), rel=1e-6
        )
        assert soil.pressure_sinkage.second == pytest.approx(2407.4e3)


@needs("emps")
def test_the_drive_keeps_its_published_parameters(tmp_path: Path) -> None:
    """Least squares on the imported recording: mass, viscous and Coulomb friction within 3 % of the
    benchmark's.
    """
    assert main(["emps", str(REAL / "emps"), "-o", str(tmp_path)]) == 0
    drive = Physical(tmp_path / "data-emps.mcap")
    assert len(drive.time("wheel_encoder")) == 24841

    force = drive.value("motor_shunt") * drive.settings.drive.torque_constant.value
    position = filtfilt(*butter(4, 0.2), drive.value("wheel_encoder"))
    speed = np.gradient(position, 1e-3)
    columns = [np.gradient(speed, 1e-3), speed, np.sign(speed), np.ones_like(speed)]
    regressors, wanted = (
        filtfilt(*butter(4, 0.04), values)[..., ::20] for values in (np.array(columns), force)
    )
    mass, viscous, coulomb, _ = np.linalg.lstsq(regressors.T, wanted, rcond=None)[0]

    assert (mass, viscous, coulomb) == pytest.approx((95.11, 203.5, 20.39), rel=0.03)
