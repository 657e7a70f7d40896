"""Every procedure finds the true calibration within its own σ, in many simulated repeats."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.procedures import datum, encoders, load, pot, shunt, soil, torque
from gritd.tools.calibrate.sources import RecordedSteps
from gritd.tools.cli.files import recording
from gritd.tools.commands.calibrate import main
from tests.tools.calibrate.bench import SETTINGS, noisy, record, rig, staircase

pytestmark = pytest.mark.long

SEEDS = 60
HEIGHTS = (0.0, 0.01, 0.02, 0.03, 0.05)
Z = 4.5e-5  # [m] of a gauge block


def within(pulls: list[float]) -> float:
    """Share of pulls, (found − true)/σ, inside 2σ."""
    return float(np.mean(np.abs(pulls) <= 2.0))


def pulls(seed_to_pull: Callable[[int], list[float]]) -> float:
    return within([pull for seed in range(SEEDS) for pull in seed_to_pull(seed)])


def of(found: Uncertain, truth: float) -> float:
    return (found.value - truth) / found.sigma


def straight_pulls(tmp_path: Path, seed: int, which: str) -> list[float]:
    """Scale and offset of one procedure on a staircase of known values."""
    rng = np.random.default_rng(seed)
    procedure, scale, offset, noise, values, sigma = {
        "pot": (pot.POT, 0.0253, -0.0127, 2e-3, HEIGHTS, Z),
        "shunt": (shunt.SHUNT, 2.03, -5.02, 2e-3, (0.0, 1.0, 2.0, -1.0, 0.0), 1e-3),
        "load": (load.LOAD, 1.02, 0.4, 0.3, (0.0, 20.0, 50.0, 100.0), 0.05),
    }[which]
    set_to = [v + sigma * rng.standard_normal() for v in values]
    time, physical = staircase(set_to)
    raw = noisy((physical - offset) / scale, noise, seed)
    if which == "load":
        raw = np.column_stack([0 * raw, 0 * raw, raw, 0 * raw, 0 * raw, 0 * raw])

    path = record(tmp_path / "r.mcap", {procedure.signal.channel: (time, raw)})
    known = [Uncertain(v, sigma) for v in values]
    found = procedure.outcome(RecordedSteps(path), known).values
    # the offset's σ is that of what is read at physical zero
    at_zero = Uncertain(
        found[0].value.value * -offset / scale + found[1].value.value, found[1].value.sigma
    )
    return [of(found[0].value, scale), of(at_zero, 0.0)]


@pytest.mark.parametrize("which", ["pot", "shunt", "load"])
def test_known_values_give_scale_and_offset(tmp_path: Path, which: str) -> None:
    assert pulls(lambda seed: straight_pulls(tmp_path, seed, which)) >= 0.9


def test_turns_and_rail_give_the_angle_of_a_count(tmp_path: Path) -> None:
    hand = np.radians(0.5)

    def wheel(seed: int) -> list[float]:
        rng = np.random.default_rng(seed)
        time, angle = staircase([2 * np.pi * n + hand * rng.standard_normal() for n in range(4)])
        path = record(tmp_path / "w.mcap", {"wheel_encoder": (time, angle / 9.6e-5)})
        known = [Uncertain(2 * np.pi * n, hand) for n in range(4)]
        found = encoders.outcome(encoders.WHEEL, RecordedSteps(path), known).values
        assert [each.path[-1] for each in found] == ["scale"]
        return [of(found[0].value, 9.6e-5)]

    def carriage(seed: int) -> list[float]:
        rng = np.random.default_rng(seed)
        time, way = staircase([x + 2e-4 * rng.standard_normal() for x in (0.0, 0.5, 1.0)])
        path = record(tmp_path / "c.mcap", {"carriage_encoder": (time, way / 0.02 / 7.7e-4)})
        known = [Uncertain(x, 2e-4) for x in (0.0, 0.5, 1.0)]
        found = encoders.outcome(encoders.CARRIAGE, RecordedSteps(path), known, 0.02).values
        return [of(found[0].value, 7.7e-4)]

    assert pulls(wheel) >= 0.9 and pulls(carriage) >= 0.9


def touch_run(path: Path, seed: int, surface: float, scatter: float) -> Path:
    """The wheel is lowered at 2 mm/s onto a stiff surface and lifted again, five times."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 50.0, 0.01)
    height = np.interp(time % 10.0, [0, 2, 7, 8, 10], [-8e-3, -8e-3, 2e-3, 2e-3, -8e-3])
    surfaces = surface + scatter * rng.standard_normal(5)
    over = height - surfaces[(time // 10).astype(int)]
    force = noisy(np.maximum(over, 0.0) * 1e6, 0.3, seed)
    position = np.where(over > 0.0, height - over, height)
    volts = noisy((position + 12.5e-3) / 25e-3, 2e-3, seed + 1)
    zeros = 0.0 * force
    six = np.column_stack([zeros, zeros, force, zeros, zeros, zeros])
    return record(path, {"sinkage_pot": (time, volts), "wrench": (time, six)})


def test_touches_give_the_zero(tmp_path: Path) -> None:
    def one(seed: int) -> list[float]:
        path = touch_run(tmp_path / "t.mcap", seed, surface=0.6e-3, scatter=1e-4)
        volts = datum.touches(recording(path), SETTINGS, contact=2.0)
        assert len(volts) == 5
        found = datum.outcome(volts, SETTINGS).values[0].value
        return [of(found, -12.5e-3 - 0.6e-3)]

    assert pulls(one) >= 0.9


def spin_run(path: Path, seed: int) -> Path:
    """A lifted wheel at three speeds both ways: T_C 0.3 N·m, B 0.5 N·m·s/rad, 10 mA of offset."""
    time, speed = staircase([0.0, 0.2, 0.4, 0.6, 0.0, -0.2, -0.4, -0.6], seconds=5.0)
    torque = 0.3 * np.sign(speed) + 0.5 * speed
    volts = (torque / 2.0 + 0.010 + 5.0) / 2.0
    angle = np.cumsum(speed) / 100.0
    return record(
        path,
        {
            "wheel_encoder": (time, angle / 0.0958738e-3),
            "motor_shunt": (time, noisy(volts, 4e-3, seed)),
        },
    )


def test_a_wheel_in_the_air_tells_friction_and_offset(tmp_path: Path) -> None:
    def one(seed: int) -> list[float]:
        path = spin_run(tmp_path / "s.mcap", seed)
        loss, damping, offset = torque.by_spinning(recording(path), SETTINGS).values
        return [of(loss.value, 0.3), of(damping.value, 0.5), of(offset.value, -5.010)]

    assert pulls(one) >= 0.9


def test_a_lever_and_a_sensor_give_the_torque_constant(tmp_path: Path) -> None:
    levels = (0.0, 1.0, 2.0, 4.0)
    true = 2.04

    def lever(seed: int) -> list[float]:
        time, held = staircase(levels)
        volts = noisy((held / true + 5.0) / 2.0, 4e-3, seed)
        path = record(tmp_path / "l.mcap", {"motor_shunt": (time, volts)})
        known = [Uncertain(v, 2e-3) for v in levels]
        return [of(torque.by_lever(RecordedSteps(path), known, SETTINGS).values[0].value, true)]

    def sensor(seed: int) -> list[float]:
        time, axle = staircase((0.5, 1.5, 2.5, 1.0), seconds=6.0)
        volts = noisy(((axle + 0.2) / true + 5.0) / 2.0, 4e-3, seed)
        zeros = 0.0 * axle
        six = np.column_stack([zeros] * 4 + [noisy(axle, 0.02, seed + 1), zeros])
        channels = {
            "wheel_encoder": (time, 0.3 * time / 0.0958738e-3),
            "motor_shunt": (time, volts),
            "wrench": (time, six),
        }
        path = record(tmp_path / "t.mcap", channels)
        return [of(torque.by_sensor(recording(path), SETTINGS).values[0].value, true)]

    assert pulls(lever) >= 0.9 and pulls(sensor) >= 0.9


def press(
    rng: np.random.Generator, radius: float, n: float, k_c: float, k_phi: float
) -> soil.Press:
    depth = np.linspace(0.0, 30e-3, 60)
    factor = np.exp(0.08 * rng.standard_normal())
    pressure = factor * (k_c / radius + k_phi) * depth ** (n + 0.03 * rng.standard_normal())
    force = pressure * np.pi * radius**2 * (1.0 + 0.01 * rng.standard_normal(depth.size))
    return soil.of_rows("test", radius, np.column_stack([force, 1e3 * depth]))


def test_plates_give_the_soil_and_its_scatter_is_that_of_the_next_bed() -> None:
    width = SETTINGS.wheel.width

    def one(seed: int) -> list[float]:
        rng = np.random.default_rng(seed)
        tests = [press(rng, r, 1.1, 9e3, 1.5e6) for r in (0.025, 0.05) for _ in range(6)]
        n, k_c, k_phi, relative = soil.outcome(tests, SETTINGS).values
        next_bed = (9e3 / width + 1.5e6) * np.exp(0.08 * rng.standard_normal())
        found = k_c.value.value / width + k_phi.value.value
        next_n = 1.1 + 0.03 * rng.standard_normal()
        return [
            (found - next_bed) / (relative.value.value * found),
            (n.value.value - next_n) / n.value.sigma,
        ]

    assert pulls(one) >= 0.88


# --- by the command line ---


def test_the_configuration_gets_value_sigma_date_and_serial_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = rig(tmp_path)
    before = file.read_text()
    time, physical = staircase(HEIGHTS)
    volts = noisy((physical + 0.0127) / 0.0253, 2e-3, 1)
    path = record(tmp_path / "pot.mcap", {"sinkage_pot": (time, volts)})
    options = ["--config", str(file), "--from", str(path), "--known", "0, 10, 20, 30, 50 mm"]

    assert main(["pot", *options]) == 0
    assert "nothing is written" in capsys.readouterr().out and file.read_text() == before

    options += ["--known-sigma", "0.01 mm", "--serial", "LP-7", "--date", "2026-11-22"]
    assert main(["pot", *options, "--in-place"]) == 0
    said = capsys.readouterr().out
    assert "(was 25 mm/V)" in said and "mm r.m.s." in said and "kept" not in said

    assert main(["pot", *options[:-4], "--apply", str(tmp_path / "later.yaml")]) == 0
    kept = "channels.sinkage_pot.serial: LP-7: kept beside the new date"
    assert kept in capsys.readouterr().out

    known = config.load(file).settings.channels["sinkage_pot"].calibration
    assert known.scale.value == pytest.approx(0.0253, rel=1e-3) and known.scale.sigma > 0.0
    assert known.offset.value == pytest.approx(-0.0127, abs=1e-4)
    assert (known.date, known.serial) == ("2026-11-22", "LP-7")
    after = file.read_text()
    assert [line for line in before.splitlines() if "#" in line and line not in after] == []
    assert file.with_name("testbed.yaml.bak").read_text() == before


def test_soil_and_friction_are_written_as_the_configuration_has_them(tmp_path: Path) -> None:
    file = rig(tmp_path)
    rng = np.random.default_rng(2)
    for number in range(8):
        test = press(rng, 0.02 + 0.02 * (number % 2), 1.0, 0.0, 2e6)
        rows = zip(test.pressure * np.pi * test.radius**2, 1e3 * test.depth, strict=True)
        text = f"9/13/2023\nPlate Diameter: {200 * test.radius:.2f}cm\nForce (N), Sinkage (mm)\n"
        (tmp_path / f"{number}.txt").write_text(
            text + "".join(f"{f:.3f},{z:.3f}\n" for f, z in rows)
        )
    files = sorted(map(str, tmp_path.glob("?.txt")))
    assert main(["soil", *files, "--config", str(file), "--in-place"]) == 0

    path = spin_run(tmp_path / "spin.mcap", 1)
    assert main(["torque", "--from", str(path), "--config", str(file), "--in-place"]) == 0

    settings = config.load(file).settings
    assert settings.soil.exponent.value == pytest.approx(1.0, abs=0.05)
    assert settings.soil.pressure_sinkage.modulus(0.071) == pytest.approx(2e6, rel=0.1)
    effects = {e.name: e.parameters for e in settings.effects}
    assert effects["coulomb_friction"]["loss"].value == pytest.approx(0.3, abs=0.02)
    assert effects["viscous_friction"]["damping"].sigma > 0.0
