"""What is known of a wheel's testbed and soil: the constants of its model with their priors, and
the noise of its sensors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.config.settings import Calibration, ConfiguredEffect, Settings, Uncertain
from gritd.estimator.effects import EFFECTS
from gritd.tools.cli.wording import percent
from gritd.tools.diagnose.rig.interface import HAD, Constant
from gritd.tools.diagnose.rig.weights import WeightSets
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SIZE, SPAN

SOIL = ("c", "tan_phi", "k", "n", "K")
LEAN = "side_force_lean"
UNITS = {
    "torque": "N·m", "axle_torque": "N·m", "drawbar_pull": "N", "side_force": "N", "load": "N",
    "sinkage": "m",
    "slip": "-", "speed": "m/s", "wheel_angle": "rad", "position": "m", "sliding": "m",
    "time": "s",
    "acceleration": "rad/s²", "heat": "A²·s", "run": "-", "direction": "-", "constant": "-",
}  # fmt: skip


def wheel_constants(
    settings: Settings,
    channels: Sequence[str],
    sets: WeightSets,
    had: Sequence[ConfiguredEffect],
) -> tuple[Constant, ...]:
    """Soil, calibration of every channel, weights, configured effects, and baseline effects."""
    return (
        *_soil(settings),
        *_calibrations(settings, channels, sets),
        *_floating(settings.effects),
        *_floating(had, HAD),
    )


def of_channel(channel: str, kind: str, sigma: float, unit: str = "") -> Constant:
    """The error of a channel's calibration, 0 ± sigma."""
    return Constant(f"{channel}_{kind}", 0.0, sigma, unit, channel=channel, kind=kind)


def _calibrations(settings: Settings, channels: Sequence[str], sets: WeightSets) -> list[Constant]:
    constants = []
    for channel in channels:
        scale, offset = calibration_sigmas(settings, channel)
        constants += [
            of_channel(channel, "scale", max(scale, TUNING.rig.scale_floor)),
            of_channel(channel, "offset", max(offset, SPAN), UNITS[channel]),
            of_channel(channel, "delay", TUNING.rig.timing, "s"),
            of_channel(channel, "blur", TUNING.rig.blur),
        ]
    if "side_force" in channels:  # the sensor may lean: a share of the load
        constants.append(Constant(LEAN, 0.0, TUNING.rig.lean))

    nominal = settings.load.nominal
    common = max(nominal.sigma / max(nominal.value, SPAN), TUNING.rig.scale_floor)
    constants.append(Constant("weights", 0.0, common))
    constants += [Constant(name, 0.0, TUNING.rig.own_weights * common) for name in sets.names]

    carriage = settings.channels["carriage_encoder"].calibration.scale
    scale = max(carriage.sigma / abs(carriage.value), TUNING.rig.scale_floor)
    return [*constants, Constant("carriage_scale", 0.0, scale)]


def calibration_sigmas(settings: Settings, channel: str) -> tuple[float, float]:
    """Relative sigma of the scale, sigma of the offset in the channel's unit."""
    if channel == "torque":
        shunt = settings.channels["motor_shunt"].calibration
        constant = settings.drive.torque_constant
        scale = float(np.hypot(_relative(shunt.scale), _relative(constant)))
        return scale, constant.value * shunt.offset.sigma

    if channel == "sinkage":
        return _sigmas(settings.channels["sinkage_pot"].calibration)

    assert settings.wrench is not None
    axis = "torque" if channel == "axle_torque" else channel
    return _sigmas(getattr(settings.wrench, axis))


def _sigmas(calibration: Calibration) -> tuple[float, float]:
    return _relative(calibration.scale), calibration.offset.sigma


def _relative(known: Uncertain) -> float:
    return known.sigma / abs(known.value) if known.value else 0.0


def raised_to_floors(settings: Settings) -> str:
    """A sentence where the soil is stated more exactly than any soil is known; '' elsewhere."""
    floors = TUNING.rig.soil_floors
    raised = [n for n, (value, sigma, _) in _stated(settings).items() if sigma < floors[n] * value]
    if not raised:
        return ""
    return (
        f"The configuration states {', '.join(raised)} more exactly than any soil is known."
        " The standard deviations are taken as"
        f" {', '.join(f'{name} {percent(floors[name])}' for name in raised)}."
    )


def _stated(settings: Settings) -> dict[str, tuple[float, float, str]]:
    """Value, standard deviation and unit of each soil constant."""
    prior = settings.soil
    modulus = prior.pressure_sinkage.modulus(settings.wheel.width)
    return {
        "c": (prior.cohesion.value, prior.cohesion.sigma, "Pa"),
        "tan_phi": (prior.tan_phi.value, prior.tan_phi.sigma, "-"),
        "k": (prior.shear_modulus.value, prior.shear_modulus.sigma, "m"),
        "n": (prior.exponent.value, prior.exponent.sigma, "-"),
        "K": (modulus, modulus * prior.modulus_sigma, "Pa/m^n"),
    }


def _soil(settings: Settings) -> tuple[Constant, ...]:
    return tuple(
        Constant(
            name,
            value,
            max(sigma, TUNING.rig.soil_floors[name] * value, SIZE),
            unit,
            True,
            name in ("k", "K"),
            TUNING.rig.soil_least.get(name, 0.0),
        )
        for name, (value, sigma, unit) in _stated(settings).items()
    )


def _floating(effects: Sequence[ConfiguredEffect], kind: str = "") -> tuple[Constant, ...]:
    """Parameters of effects float within their own uncertainty, kept inside their bounds."""
    every = ((effect, p) for effect in effects for p in EFFECTS[effect.name].parameters())
    known = ((e.name, p, e.parameters[p.name]) for e, p in every if p.name in e.parameters)
    return tuple(
        Constant(f"{name}.{p.name}", q.value, q.sigma, p.unit, low=p.low, high=p.high, kind=kind)
        for name, p, q in known
        if q.sigma > 0.0
    )


def preparation(settings: Settings) -> dict[str, float]:
    """Relative standard deviation of each soil constant from one preparation of a bed to the next:
    as `bed.repeatability` states it, else the usual one.
    """
    stated, soil = settings.bed.repeatability, settings.soil
    known = {
        "c": stated.cohesion / max(soil.cohesion.value, SPAN),
        "tan_phi": stated.tan_phi / max(soil.tan_phi.value, SPAN),
        "k": stated.shear_modulus,
    }
    return {name: known.get(name, 0.0) or usual for name, usual in TUNING.rig.prepared.items()}


def noise_of_readings(settings: Settings, loss_of_drive: bool) -> dict[str, float]:
    """Standard deviation of one reading of each channel with a sensor, in the channel's unit, as
    the configuration states it.

    loss_of_drive: whether channel torque is motor torque less axle torque.
    """
    drive = settings.drive.torque_constant.value
    factors = {"torque": ("motor_shunt", drive), "sinkage": ("sinkage_pot", 1.0)}
    channels = settings.channels
    noise = {
        channel: abs(factor * channels[name].noise * channels[name].calibration.scale.value)
        for channel, (name, factor) in factors.items()
        if name in channels
    }

    wrench = settings.wrench
    if wrench is not None:
        noise["axle_torque"] = wrench.torque_noise * abs(wrench.torque.scale.value)
        noise["drawbar_pull"] = wrench.force_noise * abs(wrench.drawbar_pull.scale.value)
        if wrench.side_force is not None:
            noise["side_force"] = wrench.force_noise * abs(wrench.side_force.scale.value)
        noise["load"] = wrench.force_noise * abs(wrench.load.scale.value)
        if loss_of_drive and "torque" in noise:
            noise["torque"] = float(np.hypot(noise["torque"], noise["axle_torque"]))
    return noise
