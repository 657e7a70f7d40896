"""Mistakes of a map that physics or the configuration forbids: each is named, with what would put
it right, and nothing is said of a map that is right.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from gritd.tools.commands import check_config, info
from gritd.tools.commands.import_rig import main
from tests.tools.importers.series.files import physical, simulated, write_csv

MAP = """\
columns:
  t: {channel: time, unit: ms}
  wheel: {channel: wheel_angle, unit: deg}
  omega: {channel: wheel_speed, unit: rpm}
  cart: {channel: carriage_position, unit: mm}
  v: {channel: carriage_speed, unit: mm/s}
  depth: {channel: sinkage, unit: mm}
  fx: {channel: drawbar_pull, unit: N}
  fz: {channel: load, unit: N}
  M: {channel: torque, unit: N*m}
wheel: {radius: 72 mm, width: 71 mm}
load: 60 N
"""
ANGLES, SPEEDS = ("wheel", "cart"), ("omega", "v")


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the packaged testbed at 60 N as a table of 50 rows a second."""
    folder = tmp_path_factory.mktemp("bench")
    found, settings = physical(simulated(folder))
    time = np.arange(0.1, 8.9, 0.02)
    at = {name: np.interp(time, *series) for name, series in found.items()}
    wheel, cart = at["wheel_encoder"], at["carriage_encoder"] * settings.pulley_radius
    columns = {
        "t": 1e3 * time,
        "wheel": np.degrees(wheel),
        "omega": np.gradient(wheel, time) * 30.0 / np.pi,
        "cart": 1e3 * cart,
        "v": 1e3 * np.gradient(cart, time),
        "depth": 1e3 * at["sinkage_pot"],
        "fx": at["fx"],
        "fz": at["fz"],
        "M": at["ty"],
        "wrapped": np.degrees(wheel) * 8.0 % 360.0,
    }
    return write_csv(folder / "run.csv", columns, lambda x: f"{x:.4f}")


def said(table: Path, folder: Path, without: tuple[str, ...], *changes: tuple[str, str]) -> None:
    """An import by the map without some columns, with changes."""
    dropped = tuple(f"  {name}:" for name in without)
    lines = [line for line in MAP.splitlines() if not line.startswith(dropped)]
    text = "\n".join(lines)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "map.yaml").write_text(text)
    assert main(["csv", str(table), "--map", f"{folder}/map.yaml", "-o", f"{folder}/out"]) == 0


def complaints(capsys: pytest.CaptureFixture[str]) -> list[str]:
    lines = [line for line in capsys.readouterr().out.splitlines() if "cannot be" in line]
    assert all(len(line) <= 300 for line in lines)
    return lines


@pytest.mark.parametrize("without", [ANGLES, SPEEDS])
def test_a_right_map_is_not_complained_of(
    table: Path, tmp_path: Path, without: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    said(table, tmp_path, without)
    assert complaints(capsys) == []


MISTAKES = [
    (SPEEDS, ("unit: ms", "unit: s"), "time .*ms"),
    (ANGLES, ("unit: ms", "unit: s"), "time .*ms"),
    (SPEEDS, ("unit: ms", "unit: us"), "time .*ms"),
    (ANGLES, ("unit: rpm", "unit: rad/s"), "wheel .*rpm"),
    (SPEEDS, ("unit: deg", "unit: rad"), "wheel .*deg"),
    (ANGLES, ("unit: mm/s", "unit: cm/s"), "carriage .*mm/s"),
    (SPEEDS, ("position, unit: mm", "position, unit: m"), "carriage .*mm"),
    (SPEEDS, ("sinkage, unit: mm", "sinkage, unit: m"), "sinkage .*mm"),
    (SPEEDS, ("sinkage, unit: mm", "sinkage, unit: um"), "sinkage .*mm"),
    (SPEEDS, ("sinkage, unit: mm", "sinkage, unit: mm, factor: -1"), "sinkage .*factor: -1"),
    (SPEEDS, ("load, unit: N", "load, unit: N, factor: -1"), "load .*factor: -1 for fz"),
    (SPEEDS, ("load, unit: N", "load, unit: N, factor: 0.102"), "load .*kg"),
    (SPEEDS, ("pull, unit: N", "pull, unit: N, factor: -1"), "pull .*factor: -1 for fx"),
    (SPEEDS, ("torque, unit: N*m", "torque, unit: N*m, factor: -1"), "factor: -1 for M"),
    (SPEEDS, ("torque, unit: N*m", "torque, unit: N*m, factor: 100"), "torque .*N[*]cm, not N[*]m"),
    (SPEEDS, ("torque, unit: N*m", "torque, unit: N*mm"), "torque .*N[*]m, not N[*]mm"),
    ((*ANGLES, "M"), ("unit: mm/s", "unit: cm/s"), "carriage .*mm/s"),
    (SPEEDS, ("position, unit: mm", "position, unit: mm, factor: -1"), "against .*factor: -1"),
    (SPEEDS, ("load: 60 N", "load: 120 N"), "load is 60 N .*120 N as stated"),
]


@pytest.mark.parametrize(("without", "change", "expected"), MISTAKES)
def test_a_mistake_is_named_with_its_remedy(
    table: Path,
    tmp_path: Path,
    without: tuple[str, ...],
    change: tuple[str, str],
    expected: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    said(table, tmp_path, without, change)
    (line,) = complaints(capsys)
    assert re.search(expected, line), line


def test_an_angle_that_wraps_is_told_and_can_be_put_right(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    eighth = (
        "wheel: {channel: wheel_angle, unit: deg",
        "wrapped: {channel: wheel_angle, unit: deg",
    )
    scale = ("unit: deg", "unit: deg, factor: 0.125")
    said(table, tmp_path, SPEEDS, eighth, scale)
    assert any("wraps: 360 deg for wrapped" in line for line in complaints(capsys))

    said(table, tmp_path, SPEEDS, eighth, ("unit: deg", "unit: deg, factor: 0.125, wraps: 360 deg"))
    assert complaints(capsys) == []


def test_an_angle_that_wraps_to_and_fro_at_rest_drives(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Noise about zero is 0 and 360 by turns, and is no scatter of the angle."""
    header, *rows = [line.split(",") for line in table.read_text().splitlines()]
    at, rng = header.index("wheel"), np.random.default_rng(1)
    first = float(rows[0][at])
    for row in rows:
        row[at] = f"{(float(row[at]) - first + 0.02 * rng.standard_normal()) % 360.0:.4f}"
    (tmp_path / "run.csv").write_text("\n".join(",".join(row) for row in [header, *rows]))
    said(tmp_path / "run.csv", tmp_path, SPEEDS, ("unit: deg", "unit: deg, wraps: 360 deg"))
    printed = capsys.readouterr().out
    assert "cannot be" not in printed and re.search(r"0\.[12]\d … 0\.[45]\d", printed)


def test_a_wheel_that_its_noise_hides_is_told(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said(table, tmp_path, SPEEDS, ("unit: deg", "unit: deg, noise: 40 deg"))
    (line,) = complaints(capsys)
    assert "noise" in line and "wheel" in line


def test_a_time_that_jumps_by_a_thousand_steps_is_told(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, *rows = table.read_text().splitlines()
    later = [f"{float(row.split(',', 1)[0]) + 3e4},{row.split(',', 1)[1]}" for row in rows[300:]]
    (tmp_path / "run.csv").write_text("\n".join([header, *rows[:300], *later]))
    said(tmp_path / "run.csv", tmp_path, SPEEDS)
    (line,) = complaints(capsys)
    assert "30.02 s" in line


def test_the_same_is_told_of_a_recording(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said(table, tmp_path, SPEEDS, ("pull, unit: N", "pull, unit: N, factor: -1"))
    recording = str(tmp_path / "out" / "run.mcap")
    complaints(capsys)

    assert info.main([recording]) == 0
    assert len(complaints(capsys)) == 1
    config = tmp_path / "out" / "csv.yaml"
    assert check_config.main([str(config), "--against", recording]) == 1
    assert len(complaints(capsys)) == 1

    text = config.read_text()
    assert text.count("scale: -1.0") == 1
    config.write_text(text.replace("scale: -1.0", "scale: 1.0"))
    assert check_config.main([str(config), "--against", recording]) == 0
    assert complaints(capsys) == []
