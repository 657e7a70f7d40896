"""Procedures with single spikes, or with a zero that creeps: right, or refused with the reason,
never wrong in silence.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.outcome import CalibrationOutcome
from gritd.tools.calibrate.procedures import pot, torque
from gritd.tools.calibrate.sources import RecordedSteps
from gritd.tools.cli.command import CommandError
from gritd.tools.cli.files import recording
from tests.tools.calibrate.bench import SETTINGS, Array, noisy, record, staircase

HEIGHTS = (0.0, 0.01, 0.02, 0.03, 0.05)
SCALE = 0.0253  # [m/V]
SEEDS = range(5)


def heights(
    path: Path, seed: int, spikes: float = 0.0, creep: float = 0.0, noise: float = 2e-3
) -> CalibrationOutcome:
    """A potentiometer on gauge blocks; so much of the readings are anything, and its zero creeps by
    so much of the span.
    """
    time, physical = staircase(HEIGHTS)
    volts = noisy((physical + 0.0127) / SCALE, noise, seed)
    volts += creep * HEIGHTS[-1] / SCALE * time / time[-1]
    spiked(volts, spikes, seed)
    record(path, {"sinkage_pot": (time, volts)})
    return pot.POT.outcome(RecordedSteps(path), [Uncertain(v, 4.5e-5) for v in HEIGHTS])


def spiked(values: Array, share: float, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    hit = rng.random(len(values)) < share
    values[hit] = rng.uniform(0.0, 5.0, hit.sum())


@pytest.mark.parametrize("seed", SEEDS)
def test_single_spikes_change_nothing_and_are_counted(tmp_path: Path, seed: int) -> None:
    outcome = heights(tmp_path / "r.mcap", seed, spikes=0.01)
    found = outcome.values[0].value
    assert abs(found.value - SCALE) <= 4.0 * found.sigma and found.sigma < 0.002 * SCALE
    assert any("spikes" in line for line in outcome.warnings)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_steady_zero_is_not_called_creeping(tmp_path: Path, seed: int) -> None:
    reported = heights(tmp_path / "r.mcap", seed).warnings
    assert not [line for line in reported if "creep" in line or "spike" in line]


@pytest.mark.parametrize("creep", [0.02, -0.02, 0.01])
@pytest.mark.parametrize("spikes", [0.0, 0.01])
def test_a_creeping_zero_is_refused(tmp_path: Path, creep: float, spikes: float) -> None:
    with pytest.raises(CommandError) as error:
        heights(tmp_path / "r.mcap", 1, spikes, creep)
    assert "\n" not in str(error.value)


def test_a_creep_that_could_not_be_seen_is_told(tmp_path: Path) -> None:
    outcome = heights(tmp_path / "r.mcap", 1, noise=0.02)
    assert outcome.warnings


def test_a_loose_contact_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="mend the wiring"):
        heights(tmp_path / "r.mcap", 1, spikes=0.15)


def spin(path: Path, seed: int, spikes: float = 0.0, creep: float = 0.0) -> CalibrationOutcome:
    """A lifted wheel, 0.3 N·m and 0.5 N·m·s/rad; creep in A a second."""
    time, speed = staircase([0.0, 0.2, 0.4, 0.6, 0.0, -0.2, -0.4, -0.6], seconds=5.0)
    current = (0.3 * np.sign(speed) + 0.5 * speed) / 2.0 + creep * time
    volts = noisy((current + 5.0) / 2.0, 4e-3, seed)
    spiked(volts, spikes, seed)
    count = np.round(np.cumsum(speed) / 100.0 / 0.0958738e-3)
    hit = np.random.default_rng(seed).random(count.size) < spikes
    count[hit] += 100_000
    record(path, {"wheel_encoder": (time, count), "motor_shunt": (time, volts)})
    return torque.by_spinning(recording(path), SETTINGS)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_spun_wheel_with_spikes_tells_its_friction(tmp_path: Path, seed: int) -> None:
    loss, damping, _ = (each.value for each in spin(tmp_path / "s.mcap", seed, 0.01).values)
    assert abs(loss.value - 0.3) <= 4.0 * loss.sigma and loss.sigma < 0.01
    assert abs(damping.value - 0.5) <= 4.0 * damping.sigma


def test_a_spun_wheel_whose_current_creeps_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="creep"):
        spin(tmp_path / "s.mcap", 1, creep=5e-4)  # 20 mA in 40 s, of 300


@pytest.mark.parametrize("seed", SEEDS)
def test_a_torque_sensor_that_creeps_does_not_change_the_constant(
    tmp_path: Path, seed: int
) -> None:
    """0.2 N·m in 60 s while the torque rises from 1 to 4 N·m."""
    time = np.arange(0.0, 60.0, 0.01)
    driven = 1.0 + 3.0 * time / 60.0 + 0.3 * np.sin(time / 2.0)
    volts = noisy((driven / 2.0 + 5.0) / 2.0, 2e-3, seed)
    axle = noisy(driven + 0.2 * time / 60.0, 0.02, seed + 1)
    zeros = 0.0 * time
    path = record(
        tmp_path / "r.mcap",
        {
            "wheel_encoder": (time, 0.3 * time / 0.0958738e-3),
            "motor_shunt": (time, volts),
            "wrench": (time, np.column_stack([zeros, zeros, zeros, zeros, axle, zeros])),
        },
    )
    outcome = torque.by_sensor(recording(path), SETTINGS)
    found = outcome.values[0].value
    assert abs(found.value - 2.0) <= 3.0 * found.sigma and found.sigma < 0.02
    assert any("creep" in line for line in outcome.warnings)
