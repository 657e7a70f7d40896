"""Errors of the calibration that stay the same for the whole run: what the filter considers but
never estimates.

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


Gradient = Callable[[Sensitivity], tuple[float, float]]


class Nuisance(NamedTuple):
    name: str
    sigma: float
    gradient: Gradient


def nuisances(settings: Settings) -> tuple[Nuisance, ...]:
    """The nuisances this configuration implies, in a fixed order."""
    return tuple(nuisance for nuisance in _all(settings) if nuisance.sigma > 0.0)


def _all(settings: Settings) -> Iterator[Nuisance]:
    channels, drive, wrench = settings.channels, settings.drive, settings.wrench
    pot, shunt = channels["sinkage_pot"].calibration, channels["motor_shunt"].calibration
    yield Nuisance("sinkage offset [m]", pot.offset.sigma, lambda s: _scaled(-1.0, s.by_sinkage))
    yield Nuisance(
        "sinkage scale [-]", _relative(pot.scale), lambda s: _scaled(-s.sinkage, s.by_sinkage)
    )
    rates = (
        _relative(channels[name].calibration.scale)
        for name in ("wheel_encoder", "carriage_encoder")
    )
    yield Nuisance("speed ratio [-]", hypot(*rates), lambda s: _scaled(1.0 - s.slip, s.by_slip))
    if drive.torque_source == "motor_shunt":
        gain = hypot(_relative(drive.torque_constant), _relative(shunt.scale))
        yield Nuisance("torque scale [-]", gain, lambda s: (s.torque, 0.0))
        yield Nuisance(
            "torque offset [N·m]",
            shunt.offset.sigma * drive.torque_constant.value,
            lambda s: (1.0, 0.0),
        )
    elif wrench is not None:
        yield Nuisance(
            "torque scale [-]", _relative(wrench.torque.scale), lambda s: (s.torque, 0.0)
        )
        yield Nuisance("torque offset [N·m]", wrench.torque.offset.sigma, lambda s: (1.0, 0.0))
    radius, model = settings.wheel.radius, settings.filter.model_sigma
    yield Nuisance("closed forms, torque [-]", model, lambda s: (s.torque, 0.0))
    yield Nuisance(
        "closed forms, pull [-]", model, lambda s: (0.0, s.torque / radius)
    )  # of the thrust, about T/r
    if wrench is None:
        yield Nuisance("load [N]", settings.load.nominal.sigma, lambda s: _scaled(-1.0, s.by_load))
        return
    yield Nuisance("load offset [N]", wrench.load.offset.sigma, lambda s: _scaled(-1.0, s.by_load))
    yield Nuisance(
        "load scale [-]", _relative(wrench.load.scale), lambda s: _scaled(-s.load, s.by_load)
    )
    yield Nuisance(
        "drawbar pull offset [N]", wrench.drawbar_pull.offset.sigma, lambda _: (0.0, 1.0)
    )
    yield Nuisance(
        "drawbar pull scale [-]",
        _relative(wrench.drawbar_pull.scale),
        lambda s: (0.0, s.drawbar_pull),
    )


def _relative(quantity: Uncertain) -> float:
    return quantity.sigma / abs(quantity.value)


def _scaled(factor: float, pair: tuple[float, float]) -> tuple[float, float]:
    return factor * pair[0], factor * pair[1]
