"""σ means what it says when the testbed is off by as much as its configuration admits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.tools.testbed.plant import schedule
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of
from tests.estimator.online.rig import SETTINGS, last_tick

MOTION = motion_of(schedule(60.0), SETTINGS.wheel.radius, 50.0)


def drawn(quantity, rng):
    return replace(quantity, value=quantity.value + quantity.sigma * rng.normal())


def drawn_calibration(calibration, rng):
    """Slope about the physical zero, and the zero itself, each off by its own sigma."""
    scale = drawn(calibration.scale, rng)
    zero = calibration.offset.value * scale.value / calibration.scale.value
    return replace(
        calibration, scale=scale, offset=drawn(Uncertain(zero, calibration.offset.sigma), rng)
    )


def drawn_rig(settings, rng):
    channels = {
        name: replace(channel, calibration=drawn_calibration(channel.calibration, rng))
        for name, channel in settings.channels.items()
    }
    axes = {
        axis: drawn_calibration(getattr(settings.wrench, axis), rng)
        for axis in ("drawbar_pull", "load", "torque")
    }
    constant = drawn(settings.drive.torque_constant, rng)
    return replace(
        settings,
        channels=channels,
        wrench=replace(settings.wrench, **axes),
        drive=replace(settings.drive, torque_constant=constant),
    )


def one_run(seed):
    """Normalised error squared of (c, tan φ), and the number of resets."""
    rng, soil = np.random.default_rng(seed), SETTINGS.soil
    c, tan_phi = max(drawn(soil.cohesion, rng).value, 50.0), drawn(soil.tan_phi, rng).value
    true = soil_of(
        SETTINGS,
        {"cohesion": c, "tan_phi": tan_phi, "shear_modulus": drawn(soil.shear_modulus, rng).value},
    )
    tick = last_tick(
        SETTINGS, simulate_run(drawn_rig(SETTINGS, rng), true, MOTION, (), seed).readings
    )
    covariance = np.array(
        [
            [tick["cohesion_sigma"] ** 2, tick["cov_c_tan_phi"]],
            [tick["cov_c_tan_phi"], tick["tan_phi_sigma"] ** 2],
        ]
    )
    error = np.array([tick["cohesion"] - c, tick["tan_phi"] - tan_phi])
    return float(error @ np.linalg.solve(covariance, error)), tick["resets"]


@pytest.mark.long
def test_a_rig_as_uncertain_as_stated_gives_estimates_as_uncertain_as_stated():
    """Original plant, every calibration and the soil drawn from its own sigma, three loads."""
    squares, resets = zip(*(one_run(seed) for seed in range(6)), strict=True)
    print(
        f"NEES {np.mean(squares):.2f} of 2,"
        f" {np.mean(np.array(squares) < 5.99):.0%} in the 95 % ellipse"
    )
    assert sum(square < 5.99 for square in squares) >= 5
    assert sum(resets) == 0
