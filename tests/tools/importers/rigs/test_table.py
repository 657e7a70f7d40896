"""Ding's points, imported and read back."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from gritd.tools.commands.import_rig import main
from tests.real_recordings import REAL, Physical, needs


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
