"""A wheel that obeys the linear model exactly: readings of a schedule of loads and slips, for tests
of the filter.
"""

from __future__ import annotations

from math import cos

import numpy as np

from gritd.estimator.messages.readings import ENCODERS, Reading
from gritd.estimator.terramechanics import linear
from tests.rig import NS

START = 1_700_000_000 * NS
THREE_LOADS = tuple(
    (4.0, load, slip) for load in (40.0, 70.0, 100.0) for slip in (0.1, 0.2, 0.3, 0.45, 0.6)
)
ONE_LOAD = tuple((4.0, 70.0, slip) for slip in (0.1, 0.2, 0.3, 0.45, 0.6)) * 3
OMEGA = 0.3  # [rad/s]


def entry_angle(settings, truth, load, slip):
    """θ₁ [rad] at which Eq. (21), with σₘ by Eq. (3), carries the load; bisection."""
    wheel, soil = settings.wheel, settings.soil
    modulus = soil.pressure_sinkage.modulus(wheel.width)
    low, high = 1e-3, 1.5
    for _ in range(60):
        theta_1 = 0.5 * (low + high)
        theta_m = (wheel.c1 + wheel.c2 * slip) * theta_1
        sigma_m = modulus * (wheel.radius * (cos(theta_m) - cos(theta_1))) ** soil.exponent.value
        carried = linear.forces(wheel, *truth, theta_1, slip, sigma_m)
        low, high = (low, theta_1) if carried.load > load else (theta_1, high)
    return theta_1, carried


def readings(settings, truth, schedule, *, seed, rate=50):
    """Yield, every tick of 0.1 s, its time [ns] and its readings. truth = (c, tan φ, k); `rate`
    readings a second.
    """
    rng = np.random.default_rng(seed)
    wheel, clock, turned, travelled = settings.wheel, 0.0, 0.0, 0.0
    tick, batch = START + NS // 10, []
    pot, shunt = (settings.channels[name].calibration for name in ("sinkage_pot", "motor_shunt"))
    wheel_count, pulley_count = (
        settings.channels[name].calibration.scale.value for name in ENCODERS
    )

    for duration, load, slip in schedule:
        theta_1, forces = entry_angle(settings, truth, load, slip)
        volts = (wheel.radius * (1.0 - cos(theta_1)) - pot.offset.value) / pot.scale.value
        current = forces.torque / settings.drive.torque_constant.value
        amplifier = (current - shunt.offset.value) / shunt.scale.value
        for _ in range(round(duration * rate)):
            # no testbed samples exactly evenly; the stamps are right
            step = rng.uniform(0.8, 1.2) / rate
            clock += step
            turned += OMEGA * step
            travelled += OMEGA * wheel.radius * (1.0 - slip) * step
            stamp = START + round(clock * NS)
            noise = rng.normal(size=4) * (2e-3, 2e-3, 0.3, 0.3)
            values = {
                "wheel_encoder": int(turned // wheel_count),
                "carriage_encoder": int(travelled / settings.pulley_radius // pulley_count),
                "sinkage_pot": float(volts + noise[0]),
                "motor_shunt": float(amplifier + noise[1]),
            }
            if settings.wrench is not None:
                pull, weight = float(forces.drawbar_pull + noise[2]), float(load + noise[3])
                values["wrench"] = (pull, 0.0, weight, 0.0, float(forces.torque), 0.0)
            if stamp > tick:
                yield tick, batch
                tick, batch = tick + NS // 10, []
            batch += [Reading(stamp, channel, value, stamp) for channel, value in values.items()]
