"""Logs of other people's bevameters: any columns, by a map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config.configuration import load
from gritd.tools import main as cli
from gritd.tools.calibrate.spikes import spikes
from tests.tools.calibrate.bench import rig

N, K = 1.1, 1.5e6  # of σ = K zⁿ [Pa]
GERMAN = """\
columns:
  Kraft [N]: {channel: load, unit: N, factor: -1}
  Weg [mm]: {channel: sinkage, unit: mm}
plate: 60 mm
plates: {press-3.csv: 50 mm}
"""
PRESSURE = """\
columns:
  p_kPa: {channel: pressure, unit: kPa}
  z: {channel: sinkage, unit: cm, factor: -1}
plate: 60 mm
"""


def press(path: Path, seed: int, diameter: float, kind: str) -> None:
    """Lowered from 5 mm above the surface to 30 mm below, and lifted; 1 % of the rows are wrong."""
    rng = np.random.default_rng(seed)
    way = np.concatenate([np.linspace(-5e-3, 30e-3, 350), np.linspace(30e-3, -5e-3, 40)])
    area = np.pi * diameter**2 / 4.0
    force = K * np.maximum(way, 0.0) ** N * area * (1.0 + 0.03 * rng.standard_normal())
    force = force + 0.2 * rng.standard_normal(way.size)
    force[350:] *= 0.2
    hit = rng.random(way.size) < 0.01
    force[hit] = rng.uniform(-5e3, 5e3, hit.sum())
    depth = way + 0.012 + 5e-5 * rng.standard_normal(way.size)  # its zero is anywhere
    if kind == "german":
        rows = [
            f"{-f:.2f};{1e3 * z:.3f}".replace(".", ",") for f, z in zip(force, depth, strict=True)
        ]
        path.write_text(
            "\n".join(["Versuch 7", "Kraft [N];Weg [mm]", *rows, ""]), encoding="cp1252"
        )
    else:
        rows = [f"{1e-3 * f / area:.4f},{-1e2 * z:.4f}" for f, z in zip(force, depth, strict=True)]
        path.write_text("\n".join(["p_kPa,z", *rows, ""]))


@pytest.mark.parametrize(("kind", "text"), [("german", GERMAN), ("pressure", PRESSURE)])
def test_any_columns_give_the_soil(tmp_path: Path, kind: str, text: str) -> None:
    config = rig(tmp_path / "bench")
    (tmp_path / "map.yaml").write_text(text)
    files = []
    for number in range(1, 6):
        files.append(tmp_path / f"press-{number}.csv")
        press(files[-1], number, 0.05 if kind == "german" and number == 3 else 0.06, kind)

    command = ["calibrate", "soil", *map(str, files), "--map", str(tmp_path / "map.yaml")]
    assert cli.main([*command, "--config", str(config), "--in-place"]) == 0
    soil = load(config).settings.soil
    assert abs(soil.exponent.value - N) <= 3.0 * soil.exponent.sigma < 0.3
    pressed = soil.pressure_sinkage.modulus(0.071) * 0.02**soil.exponent.value
    assert pressed == pytest.approx(K * 0.02**N, rel=0.08)


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        (GERMAN.replace("Weg [mm]", "Wegg"), "found no column"),
        (GERMAN.replace("plate: 60 mm\n", ""), "--plate"),
        (GERMAN.replace("channel: load", "channel: pressure"), "found a unit"),
        ("columns:\n  z: {channel: sinkage, unit: mm}\nplate: 60 mm\n", "load or pressure"),
        (GERMAN.replace("plate: 60 mm", "plate: -60 mm"), "plate"),
    ],
)
def test_a_wrong_map_is_one_line(
    tmp_path: Path, text: str, reported: str, capsys: pytest.CaptureFixture[str]
) -> None:
    config = rig(tmp_path / "bench")
    (tmp_path / "map.yaml").write_text(text)
    press(tmp_path / "press-1.csv", 1, 0.06, "german")
    command = ["calibrate", "soil", str(tmp_path / "press-1.csv"), "--config", str(config)]
    assert cli.main([*command, "--map", str(tmp_path / "map.yaml")]) in (2, 3)
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and (reported in said or "expected" in said)


def test_where_a_movement_turns_round_there_is_no_spike() -> None:
    saw = np.concatenate([np.linspace(0.0, 40.0, 25), np.linspace(40.0, 0.0, 3)] * 3)
    assert not spikes(saw).any()
    saw[[10, 31, 32]] += (30.0, -25.0, 35.0)
    assert set(np.flatnonzero(spikes(saw))) == {10, 31, 32}
