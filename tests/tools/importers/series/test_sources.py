"""A map of several files or groups, each with a clock of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import gritd
from gritd.config import packaged
from gritd.estimator.recording.salvage import read
from gritd.tools import main as cli
from gritd.tools.cli.command import CommandError
from gritd.tools.commands.import_rig import main
from gritd.tools.importers.series.sources import stem
from tests.tools.importers.series.files import simulated

rng = np.random.default_rng(2)
T = np.arange(0.0, 6.0, 0.01)
MAP = """
files:
  "*_wheel.npz":
    columns: {t: {channel: time, unit: s}, value: {channel: wheel_angle, unit: rad}}
  "*_cart.npz":
    rate: 50 Hz
    columns: {value: {channel: carriage_position, unit: m}}
  "*_force.npz":
    shift: SHIFT
    columns: {t: {channel: time, unit: ms}, value: {channel: drawbar_pull, unit: N}}
  "*_torque.npz":
    columns: {t: {channel: time, unit: s}, value: {channel: torque, unit: N*m}}
wheel: {radius: 72 mm, width: 71 mm}
load: 50 N
runs: {b: {load: 70 N}}
"""


def sensors(folder: Path, run: str, late: float = 0.0) -> None:
    """A file a sensor: the load cell's own clock begins `late` before the others."""
    np.savez(folder / f"{run}_wheel.npz", t=T, value=1.5 * T)
    np.savez(folder / f"{run}_cart.npz", value=0.06 * T[::2])
    force = 1e3 * (T[::4] - late)
    np.savez(folder / f"{run}_force.npz", t=force, value=5.0 + T[::4] + 0.01 * rng.random(150))
    np.savez(folder / f"{run}_torque.npz", t=T, value=2.0 * T + 0.01 * rng.random(T.size))


def importing(folder: Path, shift: str = "0 s", *more: str) -> int:
    (folder / "map.yaml").write_text(MAP.replace("SHIFT", shift))
    output = str(folder / "out")
    return main(["csv", str(folder), "--map", str(folder / "map.yaml"), "-o", output, *more])


def complaint(folder: Path, shift: str = "0 s") -> str:
    with pytest.raises(CommandError) as error:
        importing(folder, shift)
    line = str(error.value)
    assert "\n" not in line and len(line) < 300
    return line


def test_a_file_a_sensor(tmp_path: Path) -> None:
    sensors(tmp_path, "a")
    sensors(tmp_path, "b", late=2.0)
    assert importing(tmp_path) == 0

    recording = read(tmp_path / "out" / "a.mcap")
    rates = {
        name: len(recording.arrays(f"/raw/{name}")) / 6.0
        for name in ("wheel_encoder", "carriage_encoder", "wrench")
    }
    assert rates == {"wheel_encoder": 100.0, "carriage_encoder": 50.0, "wrench": 25.0}
    loads = {name: read(tmp_path / "out" / f"{name}.mcap").run.nominal_load for name in "ab"}
    assert loads == {"a": 50.0, "b": 70.0}

    wrench = recording.arrays("/raw/wrench")
    time = (wrench["stamp"] - recording.arrays("/raw/wheel_encoder")["stamp"][0]) * 1e-9
    np.testing.assert_allclose(wrench["fx"], 5.0 + time, atol=0.02)
    np.testing.assert_allclose(wrench["ty"], 2.0 * time, atol=0.02)


def test_a_clock_is_shifted(tmp_path: Path) -> None:
    sensors(tmp_path, "b", late=2.0)
    assert importing(tmp_path, "2 s") == 0
    recording = read(tmp_path / "out" / "b.mcap")
    wrench, wheel = (recording.arrays(f"/raw/{name}") for name in ("wrench", "wheel_encoder"))
    assert wrench["stamp"][0] == wheel["stamp"][0]
    assert "clocks that run together" in complaint(tmp_path, "100 s")


def test_files_that_do_not_belong_together_are_told(tmp_path: Path) -> None:
    sensors(tmp_path, "a")
    (tmp_path / "a_cart.npz").rename(tmp_path / "b_cart.npz")
    line = complaint(tmp_path)
    assert "'*_cart.npz'" in line and "'a'" in line

    other = tmp_path / "other.npz"
    np.savez(other, x=T)
    (tmp_path / "map.yaml").write_text(MAP.replace("SHIFT", "0 s"))
    with pytest.raises(CommandError) as error:
        main(["csv", str(other), "--map", str(tmp_path / "map.yaml"), "-o", str(tmp_path / "o")])
    assert str(other) in str(error.value) and "*_force.npz" in str(error.value)


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_what_was_exported_comes_in_again(tmp_path: Path, form: str) -> None:
    """Every reading to the nanosecond and to the last bit."""
    pytest.importorskip("pyarrow" if form == "parquet" else "csv")
    truth = simulated(tmp_path)
    exported = tmp_path / "again"
    assert cli.main(["export", str(truth), f"--{form}", "-o", str(exported)]) == 0

    stamp = "stamp: {channel: time, unit: ns}"
    lines = ["files:"]
    for name, columns in {
        "wheel_encoder": "count: {channel: wheel_count, unit: count}",
        "carriage_encoder": "count: {channel: carriage_count, unit: count}",
        "sinkage_pot": "volts: {channel: sinkage_volts, unit: V}",
        "motor_shunt": "volts: {channel: shunt_volts, unit: V}",
        "wrench": "fx: {channel: drawbar_pull, unit: N}, fz: {channel: load, unit: N}",
    }.items():
        lines.append(f"  raw_{name}.{form}: {{columns: {{{stamp}, {columns}}}}}")
    (tmp_path / "map.yaml").write_text("\n".join([*lines, "load: 60 N"]))
    options = ["--map", tmp_path / "map.yaml", "--config", packaged(), "-o", tmp_path / "out"]
    assert main(["csv", str(exported), *map(str, options)]) == 0

    before, after = read(truth), read(tmp_path / "out" / "again.mcap")
    for topic, fields in {
        "wheel_encoder": ["count"],
        "carriage_encoder": ["count"],
        "sinkage_pot": ["volts"],
        "motor_shunt": ["volts"],
        "wrench": ["fx", "fz"],
    }.items():
        old, new = before.arrays(f"/raw/{topic}"), after.arrays(f"/raw/{topic}")
        for name in ("stamp", *fields):
            np.testing.assert_array_equal(old[name], new[name], err_msg=f"{topic} {name}")


# --- groups of one file ---


def grouped(folder: Path) -> Path:
    long, short = T[:500], T[:510]
    roll = {"time": long, "speed": 1.0 + 0.1 * np.sin(long), "effort": np.cos(long)}
    travel = 0.06 * short
    savemat(folder / "a.mat", {"roll": roll, "yaw": {"time": short, "position": travel}})
    return folder / "a.mat"


def test_every_group_of_a_file_is_offered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["csv", str(grouped(tmp_path)), "--guess"]) == 0
    reported = capsys.readouterr().out
    for name in ("roll.time", "roll.speed", "roll.effort", "yaw.time", "yaw.position"):
        assert name in reported


def test_groups_of_several_lengths_are_one_run(tmp_path: Path) -> None:
    path, map_file = grouped(tmp_path), tmp_path / "map.yaml"
    text = """
columns:
  roll.time: {channel: time, unit: s}
  speed: {channel: wheel_speed, unit: rad/s}
  YAW
  yaw.position: {channel: carriage_position, unit: m}
wheel: {radius: 72 mm, width: 71 mm}
load: 50 N
"""
    command = ["csv", str(path), "--map", str(map_file), "-o", str(tmp_path / "out")]
    map_file.write_text(text.replace("YAW", "yaw.time: {channel: time, unit: s}"))
    assert main(command) == 0
    recording = read(tmp_path / "out" / "a.mcap")
    assert len(recording.arrays("/raw/wheel_encoder")) == 500
    assert len(recording.arrays("/raw/carriage_encoder")) == 510

    for wrong, reported in (
        ("# none", "found no time for 'yaw.position'"),
        ("time: {channel: time, unit: s}", "roll.time, yaw.time"),
        ("yaw.tim: {channel: time, unit: s}", "did you mean yaw.time?"),
    ):
        map_file.write_text(text.replace("YAW", wrong))
        with pytest.raises(CommandError) as error:
            main(command)
        assert reported in str(error.value) and len(str(error.value)) < 300


@pytest.mark.parametrize(
    ("name", "run"),
    [("a.csv.gz", "a"), ("b.TDMS", "b"), ("c.d.mat", "c.d"), ("e", "e"), ("f.csv", "f")],
)
def test_a_run_is_called_by_its_file(name: str, run: str) -> None:
    assert stem(name) == run


def test_a_rate_of_one_column_counts_its_empty_rows(tmp_path: Path) -> None:
    """A pull that begins late, and has a gap, was still read so many times a second."""
    rows = [
        f"{at / 50:.2f},{at},{3 * at},{9 + at % 3},{'' if at < 30 or at == 60 else at}"
        for at in range(120)
    ]
    (tmp_path / "a.csv").write_text("\n".join(["t,w,v,z,F", *rows]) + "\n")
    (tmp_path / "map.yaml").write_text(
        "columns:\n  t: {channel: time, unit: s}\n  w: {channel: wheel_angle, unit: deg}\n"
        "  v: {channel: carriage_position, unit: mm}\n  z: {channel: sinkage, unit: mm}\n"
        "  F: {channel: drawbar_pull, unit: N, rate: 50 Hz}\n"
        "wheel: {radius: 72 mm, width: 71 mm}\nload: 70 N\n"
    )
    options = ("--map", f"{tmp_path}/map.yaml", "-o", f"{tmp_path}/out")
    assert main(["series", str(tmp_path / "a.csv"), *options]) == 0
    run = gritd.read(tmp_path / "out" / "a.mcap")
    forces, wheel = run["raw/wrench"]["stamp"], run["raw/wheel_encoder"]["stamp"]
    expected = [wheel[at] for at in range(120) if at >= 30 and at != 60]
    assert np.allclose(forces - wheel[0], np.array(expected) - wheel[0], atol=1000)
