"""A motor without a carriage: its table is imported, tells its friction, and is diagnosed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config.configuration import load
from gritd.tools import main as cli
from gritd.tools.cli.files import recording
from gritd.tools.diagnose.rig.signals import drive_series, is_drive

MAP = """\
columns:
  Time [s]: {channel: time, unit: s}
  Angle [turn]: {channel: wheel_angle, unit: turn}
  Current [A]: {channel: current, unit: A}
torque_constant: {value: 2 N*m/A, sigma: 0.01 N*m/A}
"""
LOSS, DAMPING, OFFSET = 0.3, 0.05, 0.012  # [N·m], [N·m·s/rad], [A]


def table(path: Path) -> Path:
    """A lifted wheel at three speeds both ways, 50 Hz; one current in a hundred is anything."""
    rng, time = np.random.default_rng(1), np.arange(0.0, 40.0, 0.02)
    levels = np.array([0.0, 1.0, 2.0, 3.0, 0.0, -1.0, -2.0, -3.0])
    knots = np.repeat(5.0 * np.arange(8), 2) + np.tile([0.3, 4.7], 8)
    speed = np.interp(time, knots, np.repeat(levels, 2))
    torque = LOSS * np.sign(speed) + DAMPING * speed
    current = torque / 2.0 + OFFSET + 0.003 * rng.standard_normal(time.size)
    hit = rng.random(time.size) < 0.01
    current[hit] = rng.uniform(-5.0, 5.0, hit.sum())
    rows = zip(time, np.cumsum(speed) * 0.02 / (2.0 * np.pi), current, strict=True)
    lines = [f"{t:.2f};{turns:.5f};{amps:.4f}" for t, turns, amps in rows]
    path.write_text("\n".join(["Time [s];Angle [turn];Current [A]", *lines, ""]))
    return path


def test_a_table_of_a_drive_goes_through_the_same_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    log, out = table(tmp_path / "spin.csv"), tmp_path / "out"
    command = ["import", "csv", str(log), "--map", str(tmp_path / "map.yaml"), "-o", str(out)]
    assert cli.main(command) == 0
    assert "a drive without a carriage" in capsys.readouterr().out

    spin, config = out / "spin.mcap", out / "csv.yaml"
    assert cli.main(["check-config", str(config)]) == 0
    assert "nothing of the soil" in capsys.readouterr().out
    command = ["calibrate", "torque", "--config", str(config), "--from", str(spin), "--in-place"]
    assert cli.main(command) == 0
    assert "single spikes" in capsys.readouterr().out

    settings = load(config).settings
    found = {effect.name: effect.parameters for effect in settings.effects}
    offset = settings.channels["motor_shunt"].calibration.offset
    for value, truth in (
        (found["coulomb_friction"]["loss"], LOSS),
        (found["viscous_friction"]["damping"], DAMPING),
        (offset, -OFFSET),
    ):
        assert abs(value.value - truth) <= 4.0 * value.sigma < 0.1 * abs(truth)

    recorded = recording(spin)
    assert is_drive([recorded]) and len(drive_series(recorded, settings)) == 2


@pytest.mark.parametrize(
    "columns",
    [
        "a: {channel: wheel_angle, unit: rad}",
        "c: {channel: current, unit: A}\n  a: {channel: sinkage, unit: mm}",
    ],
)
def test_what_is_no_whole_drive_needs_a_carriage(
    tmp_path: Path, columns: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without its current, or with sinkage, a column was forgotten."""
    wheel = "wheel: {radius: 1 m, width: 1 m}\n"
    (tmp_path / "map.yaml").write_text(
        f"columns:\n  t: {{channel: time, unit: s}}\n  {columns}\n{wheel}"
    )
    rows = [f"{0.02 * n:.2f},{n % 7},{n % 5}" for n in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(["t,a,c", *rows, ""]))
    command = ["import", "csv", str(tmp_path / "a.csv"), "--map", str(tmp_path / "map.yaml")]
    assert cli.main([*command, "-o", str(tmp_path / "out")]) == 2
    assert "expected one with channel" in capsys.readouterr().err
