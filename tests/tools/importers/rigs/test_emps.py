"""The EMPS drive, imported and read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from gritd.tools.commands.import_rig import main
from tests.real_recordings import REAL, Physical, needs


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
