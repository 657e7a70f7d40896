"""Simulate, write as a stranger would, import by a map: the channels are the same."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.recording.salvage import read
from gritd.tools.commands.import_rig import main
from gritd.tools.diagnose.rig.signals import signals
from tests.tools.importers.series.files import merged, physical, simulated, write_csv

MAP = """
columns:
  time: {channel: time, unit: ms}
  wheel_encoder: {channel: wheel_angle, unit: deg}
  carriage_encoder: {channel: carriage_position, unit: cm}
  sinkage_pot: {channel: sinkage, unit: mm, factor: -1, offset: {value: 2 mm, sigma: 0.1 mm}}
  motor_shunt: {channel: current, unit: mA, factor: {value: 2, sigma: 0.01}}
  fx: {channel: drawbar_pull, unit: kN}
  fz: {channel: load, unit: N}
  ty: {channel: torque, unit: Nm, noise: 30 mN*m}
runs: {run.csv: {load: 60 N, pass: 2, start: 10 cm, operator: A. Engineer, notes: first}}
"""


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("truth"))


def stranger(run: Path) -> dict[str, np.ndarray]:
    """The run in a stranger's units and signs."""
    series, settings = physical(run)
    columns = merged(series)
    factors = {
        "time": 1e3,
        "wheel_encoder": np.degrees(1.0),
        "carriage_encoder": 1e2 * settings.pulley_radius,
        "motor_shunt": 500.0,
        "fx": 1e-3,
    }
    columns = {name: values * factors.get(name, 1.0) for name, values in columns.items()}
    columns["sinkage_pot"] = 2.0 - 1e3 * columns["sinkage_pot"]
    return columns


@pytest.mark.parametrize("kind", ["csv", "parquet", "mat"])
def test_imported_channels_are_those_that_were_written(
    truth: Path, tmp_path: Path, kind: str
) -> None:
    columns, path = stranger(truth), tmp_path / f"run.{kind}"
    if kind == "csv":
        write_csv(path, columns)
    elif kind == "mat":
        savemat(path, columns)
    else:
        pyarrow = pytest.importorskip("pyarrow")
        pytest.importorskip("pyarrow.parquet").write_table(pyarrow.table(dict(columns)), path)

    (tmp_path / "map.yaml").write_text(MAP.replace("run.csv", path.name))
    options = ["--map", tmp_path / "map.yaml", "--config", packaged(), "-o", tmp_path / "out"]
    assert main(["csv", str(path), *map(str, options)]) == 0

    recording = read(tmp_path / "out" / "run.mcap")
    info = recording.run
    assert (info.nominal_load, info.pass_number, info.start_position) == (60.0, 2, 0.1)

    (found, _), (known, _) = physical(tmp_path / "out" / "run.mcap"), physical(truth)
    for name, (time, values) in known.items():
        assert found[name][0] == pytest.approx(time, abs=2e-6), name
        # an encoder begins to count where the file does, in whole digits of the file
        start = values[0] if name.endswith("encoder") else 0.0
        offset = found[name][1][0] if name.endswith("encoder") else 0.0
        np.testing.assert_allclose(
            found[name][1] - offset, values - start, rtol=1e-6, atol=1e-9, err_msg=name
        )


def test_uncertainty_and_noise_go_into_the_configuration(truth: Path, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "run.csv", stranger(truth))
    (tmp_path / "map.yaml").write_text(MAP)
    options = ["--map", tmp_path / "map.yaml", "--config", packaged(), "-o", tmp_path]
    main(["csv", str(path), *map(str, options)])
    settings, original = (config.load(p).settings for p in (tmp_path / "csv.yaml", packaged()))

    pot, shunt = settings.channels["sinkage_pot"], settings.channels["motor_shunt"]
    assert pot.calibration.offset.sigma == pytest.approx(1e-4)
    assert shunt.calibration.scale.sigma == pytest.approx(1e-5)

    # estimated, in SI, and as stated
    for name in ("sinkage_pot", "motor_shunt"):
        estimated, stated = (
            s.channels[name].noise * abs(s.channels[name].calibration.scale.value)
            for s in (settings, original)
        )
        assert estimated == pytest.approx(stated, rel=0.15), name
    assert settings.wrench is not None and original.wrench is not None
    assert settings.wrench.force_noise == pytest.approx(original.wrench.force_noise, rel=0.15)
    assert settings.wrench.torque_noise == 0.03


def test_a_gap_stays_a_gap(truth: Path, tmp_path: Path) -> None:
    """Neither rows that are missing nor empty cells are filled."""
    columns = stranger(truth)
    seconds = columns["time"] * 1e-3
    kept = (seconds < 3.0) | (seconds > 4.0)
    columns = {name: values[kept] for name, values in columns.items()}
    seconds = seconds[kept]
    columns["sinkage_pot"][(seconds > 5.0) & (seconds < 6.0)] = np.nan

    path = write_csv(tmp_path / "run.csv", columns)
    (tmp_path / "map.yaml").write_text(MAP)
    options = ["--map", tmp_path / "map.yaml", "--config", packaged(), "-o", tmp_path]
    main(["csv", str(path), *map(str, options)])

    recording = read(tmp_path / "run.mcap")
    silent = {"wheel_encoder": [(3.0, 4.0)], "sinkage_pot": [(3.0, 4.0), (5.0, 6.0)]}
    for name, gaps in silent.items():
        stamp = recording.arrays(f"/raw/{name}")["stamp"]
        time = (stamp - read(tmp_path / "run.mcap").arrays("/raw/wheel_encoder")["stamp"][0]) * 1e-9
        long = [(a, b) for a, b in pairwise(time) if b - a > 0.1]
        assert np.array(long) == pytest.approx(np.array(gaps), abs=0.02)


def test_resampled_readings_are_means_of_rows(truth: Path, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "run.csv", stranger(truth))
    (tmp_path / "map.yaml").write_text(f"{MAP}resample: 50 Hz\n")
    options = ["--map", tmp_path / "map.yaml", "--config", packaged(), "-o", tmp_path]
    main(["csv", str(path), *map(str, options)])
    recording = read(tmp_path / "run.mcap")
    stamp = recording.arrays("/raw/sinkage_pot")["stamp"]
    assert np.median(np.diff(stamp)) == pytest.approx(2e7, rel=0.05)

    found = signals(recording, config.load(tmp_path / "csv.yaml").settings, 5.0)
    known = signals(read(truth), config.load(packaged()).settings, 5.0)
    count = min(found.time.size, known.time.size) - 1
    for name in ("sinkage", "current", "load"):
        np.testing.assert_allclose(
            np.nanmean(found.analogue[name][8:count]),
            np.nanmean(known.analogue[name][8:count]),
            rtol=2e-3,
        )
