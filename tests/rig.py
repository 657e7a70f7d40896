"""A small testbed configuration and steady readings, for tests that need no physics."""

from __future__ import annotations

from math import pi

import numpy as np

from gritd.estimator.config.settings import (
    Calibration,
    Channel,
    ConfiguredEffect,
    Drive,
    FilterSettings,
    Load,
    Logging,
    Rates,
    Settings,
    SoilPrior,
    Uncertain,
    Wrench,
)
from gritd.estimator.messages.readings import Reading
from gritd.estimator.terramechanics.soil import PressureSinkage, Wheel

NS = 1_000_000_000
PULLEY = 0.02  # [m]
COUNT = 2 * pi / 65536  # [rad]
PULLEY_COUNT = 2 * pi / 8192  # [rad]
# what the stages up to the vertical balance add to a `Situation`
BALANCED = dict(
    cohesion=1000.0,
    tan_phi=0.6,
    shear_modulus=0.02,
    sinkage=0.02,
    carried=60.0,
    theta_1=0.8,
    torque=2.0,
    drawbar_pull=3.0,
)


def calibration(scale, offset=0.0, scale_sigma=0.0, offset_sigma=0.0):
    return Calibration(Uncertain(scale, scale_sigma), Uncertain(offset, offset_sigma))


def channel(name, scale, offset=0.0, noise=0.3, low=-1e18, high=1e18, max_rate=1e18):
    return Channel(
        name, "adc", name, calibration(scale, offset), noise, low, high, max_rate=max_rate
    )


CHANNELS = {
    "wheel_encoder": channel("wheel_encoder", COUNT, max_rate=2e5),
    "carriage_encoder": channel("carriage_encoder", PULLEY_COUNT, max_rate=5e4),
    "sinkage_pot": channel("sinkage_pot", 0.01, -0.002, noise=2e-3, low=0.0, high=5.0),
    "motor_shunt": channel("motor_shunt", 2.0, 0.0, noise=2e-3, low=-5.0, high=5.0),
}

SOIL = SoilPrior(
    cohesion=Uncertain(1000.0, 300.0),
    tan_phi=Uncertain(0.577, 0.06),
    shear_modulus=Uncertain(0.025, 0.0025),
    exponent=Uncertain(1.1, 0.05),
    pressure_sinkage=PressureSinkage("bekker", 1.1, 0.9e3, 1523.4e3),
    modulus_sigma=0.1,
)

# tests of the filter drive a plant that obeys the closed forms
TRIANGLES = ConfiguredEffect("stress_linearisation", {"share": Uncertain(0.0)})

SETTINGS = Settings(
    testbed="test",
    wheel=Wheel(0.072, 0.071),
    pulley_radius=PULLEY,
    soil=SOIL,
    drive=Drive(Uncertain(2.0)),
    load=Load(Uncertain(70.0)),
    channels=CHANNELS,
    wrench=None,
    devices={},
    rates=Rates(),
    filter=FilterSettings(),
    logging=Logging(),
    effects=(TRIANGLES,),
)

WRENCH = Wrench("adc", "wrench", calibration(1.0), calibration(1.0), calibration(1.0), 0.3, 0.02)


def readings_of(
    start,
    *,
    seconds,
    omega=0.4,
    speed=0.02,
    sinkage=0.011,
    current=1.7,
    noise=False,
    frozen=("", 0.0),
    seed=0,
):
    """Readings of steady motion at 250 Hz a channel, received when sampled. frozen = (channel, from
    second).
    """
    rng = np.random.default_rng(seed)
    steps = round(seconds * 250)
    scatter = rng.normal(size=(steps, 2)) * (2e-3 if noise else 0.0)
    readings, held = [], None

    for k in range(steps):
        t = k * 0.004
        stamp = start + k * 4_000_000
        values = {
            "wheel_encoder": int(omega * t / COUNT // 1),
            "carriage_encoder": int(speed * t / PULLEY / PULLEY_COUNT // 1),
            "sinkage_pot": (sinkage + 0.002) / 0.01 + scatter[k, 0],
            "motor_shunt": current / 2.0 + scatter[k, 1],
        }
        name, since = frozen
        if name and t >= since:
            held = values[name] if held is None else held
            values[name] = held
        readings += [Reading(stamp, channel, value, stamp) for channel, value in values.items()]

    return readings
