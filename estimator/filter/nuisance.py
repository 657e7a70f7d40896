"""Errors that stay the same for the whole run, and that the filter estimates together with the
soil.

Each nuisance is zero mean with the standard deviation stated in the configuration. Its gradient
says how the prediction of the measured torque and drawbar pull changes with it. Nuisances of zero
sigma are left out.

A calibration has two: its zero (sigma of the offset) and its slope about that zero (sigma of the
scale, as a share of the physical value). An amplifier that rests at 2.5 V is zeroed at rest, so its
slope does not move the zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import hypot
from typing import NamedTuple

from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.messages.readings import ENCODERS


class Sensitivity(NamedTuple):
    """A linearised prediction: T [N·m] and DP [N], and how each follows sinkage, slip and load."""

    torque: float
    drawbar_pull: float
    sinkage: float  # z [m]
    slip: float  # i [-]
    load: float  # W [N]
    by_sinkage: tuple[float, float]  # ∂(T, DP)/∂z [N, N/m]
    by_slip: tuple[float, float]  # ∂(T, DP)/∂i [N·m, N]
    by_load: tuple[float, float]  # ∂(T, DP)/∂W [m, -]
    by_exponent: tuple[float, float]  # ∂(T, DP)/∂n [N·m, N]
    by_peak: tuple[float, float]  # ∂(T, DP)/∂(θₘ/θ₁) [N·m, N]


Gradient = Callable[[Sensitivity], tuple[float, float]]


class Nuisance(NamedTuple):
    name: str
    sigma: float
    gradient: Gradient


def nuisances(settings: Settings) -> tuple[Nuisance, ...]:
    """The nuisances this configuration implies, in a fixed order."""
    return tuple(nuisance for nuisance in _all(settings) if nuisance.sigma > 0.0)


# the shape of the stresses: the model itself follows these (measurement.py)
EXPONENT, PEAK, PEAK_BY_SLIP = "exponent n", "c1", "c2"


def _all(settings: Settings) -> Iterator[Nuisance]:
    yield from _of_stresses(settings)
    yield from _of_motion(settings)
    yield from _of_torque(settings)
    yield from _of_closed_forms(settings)
    yield from _of_forces(settings)


def _of_stresses(settings: Settings) -> Iterator[Nuisance]:
    """The exponent n, and the place of the stress peak θₘ = (c₁ + c₂ i) θ₁."""
    peak = settings.peak
    yield Nuisance(EXPONENT, settings.soil.exponent.sigma, lambda s: s.by_exponent)
    yield Nuisance(PEAK, peak.c1_sigma, lambda s: s.by_peak)
    yield Nuisance(PEAK_BY_SLIP, peak.c2_sigma, lambda s: _scaled(s.slip, s.by_peak))


def _of_motion(settings: Settings) -> Iterator[Nuisance]:
    """Sinkage and slip."""
    pot = settings.channels["sinkage_pot"].calibration
    yield Nuisance("sinkage offset [m]", pot.offset.sigma, lambda s: _scaled(-1.0, s.by_sinkage))
    yield Nuisance(
        "sinkage scale [-]", _relative(pot.scale), lambda s: _scaled(-s.sinkage, s.by_sinkage)
    )

    encoders = (settings.channels[name].calibration for name in ENCODERS)
    ratio = hypot(*(_relative(calibration.scale) for calibration in encoders))
    yield Nuisance("speed ratio [-]", ratio, lambda s: _scaled(1.0 - s.slip, s.by_slip))


def _of_torque(settings: Settings) -> Iterator[Nuisance]:
    """From the motor's current, or from the wrench."""
    drive, wrench = settings.drive, settings.wrench
    if drive.torque_source == "motor_shunt":
        shunt = settings.channels["motor_shunt"].calibration
        scale = hypot(_relative(drive.torque_constant), _relative(shunt.scale))
        offset = shunt.offset.sigma * drive.torque_constant.value
    elif wrench is not None and drive.torque_source == "wrench":
        scale, offset = _relative(wrench.torque.scale), wrench.torque.offset.sigma
    else:
        return

    yield Nuisance("torque scale [-]", scale, lambda s: (s.torque, 0.0))
    yield Nuisance("torque offset [N·m]", offset, lambda s: (1.0, 0.0))


def _of_closed_forms(settings: Settings) -> Iterator[Nuisance]:
    """What the closed forms miss: a share of the torque, and of the thrust, which is about T/r."""
    radius, sigma = settings.wheel.radius, settings.filter.model_sigma
    yield Nuisance("closed forms, torque [-]", sigma, lambda s: (s.torque, 0.0))
    yield Nuisance("closed forms, pull [-]", sigma, lambda s: (0.0, s.torque / radius))


def _of_forces(settings: Settings) -> Iterator[Nuisance]:
    """Load and drawbar pull by the wrench; without one the weights."""
    wrench = settings.wrench
    if wrench is None:
        sigma = settings.load.nominal.sigma
        yield Nuisance("load [N]", sigma, lambda s: _scaled(-1.0, s.by_load))
        return

    load, pull = wrench.load, wrench.drawbar_pull
    yield Nuisance("load offset [N]", load.offset.sigma, lambda s: _scaled(-1.0, s.by_load))
    yield Nuisance("load scale [-]", _relative(load.scale), lambda s: _scaled(-s.load, s.by_load))
    if not wrench.pulls:
        return
    yield Nuisance("drawbar pull offset [N]", pull.offset.sigma, lambda _: (0.0, 1.0))
    yield Nuisance("drawbar pull scale [-]", _relative(pull.scale), lambda s: (0.0, s.drawbar_pull))


def _relative(quantity: Uncertain) -> float:
    return quantity.sigma / abs(quantity.value)


def _scaled(factor: float, pair: tuple[float, float]) -> tuple[float, float]:
    return factor * pair[0], factor * pair[1]
