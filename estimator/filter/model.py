"""What the filter expects the sensors to say: the closed forms, with the configured effects applied
to them.
"""

from __future__ import annotations

from math import cos, hypot, log, sin
from typing import NamedTuple

from gritd.estimator.compiled import arithmetic
from gritd.estimator.config.settings import Settings
from gritd.estimator.effects.stress_linearisation import StressLinearisation
from gritd.estimator.filter.shift import SLIP, THETA_1, IntegralShift
from gritd.estimator.terramechanics import linear, scalar
from gritd.estimator.terramechanics.soil import Soil, Wheel
from gritd.estimator.wheel.chain import Chain
from gritd.estimator.wheel.sync import Measured


class Quantity(NamedTuple):
    """A predicted force or torque and its gradient, SI."""

    value: float
    by_c: float  # [1/Pa]
    by_tan_phi: float
    by_ln_k: float
    by_theta_1: float
    by_slip: float
    by_load: float


class Prediction(NamedTuple):
    torque: Quantity  # T [N·m]
    drawbar_pull: Quantity  # DP [N]
    resistance: Quantity  # [N]


class WheelModel:
    """Eqs. (20)-(22) for one wheel, σₘ eliminated through (21)."""

    def __init__(self, settings: Settings, chain: Chain, exponent_error: float = 0.0) -> None:
        self._wheel = chain.wheel
        self._soil = settings.soil
        self._modulus = settings.soil.pressure_sinkage.modulus(settings.wheel.width)
        self._exponent_error = exponent_error
        self._shift = _shift(settings, chain)
        self._closed = _compiled(self._wheel, self._shift)

    def predict(
        self, c: float, tan_phi: float, k: float, theta_1: float, slip: float, load: float
    ) -> Prediction:
        """T, DP and resistance with gradients; c [Pa], k [m], θ₁ > 0 [rad], W [N]."""
        if self._closed is not None:
            known = self._closed.predict(c, tan_phi, k, theta_1, slip, load, self._exponent_error)
            if known is not None:
                return Prediction(*known)

        p = scalar.predict(
            self._wheel, c, tan_phi, k, theta_1, slip, load, self._at(k, theta_1, slip)
        )
        return Prediction(
            Quantity(p.torque, *p.torque_gradient),
            Quantity(p.drawbar_pull, *p.drawbar_pull_gradient),
            Quantity(p.resistance, *p.resistance_gradient),
        )

    def _at(self, k: float, theta_1: float, slip: float) -> linear.Shift | None:
        return (
            None if self._shift is None else self._shift.at(k, theta_1, slip, self._exponent_error)
        )

    def load(
        self, c: float, tan_phi: float, k: float, theta_1: Measured, theta_m: float, slip: float
    ) -> Measured:
        """W [N] by Eq. (21) with σₘ of Eq. (3) and the prior moduli; its σ is that of the moduli
        and of θ₁.
        """
        radius, soil = self._wheel.radius, self._soil
        depth = radius * (cos(theta_m) - cos(theta_1.value))
        if depth <= 0.0:
            return Measured(0.0, 0.0)

        sigma_m = self._modulus * depth**soil.exponent.value
        load = self._carried(c, tan_phi, k, theta_1.value, slip, sigma_m)
        by_angle = soil.exponent.value * radius * sin(theta_1.value) / depth
        relative = hypot(
            soil.modulus_sigma, log(depth) * soil.exponent.sigma, by_angle * theta_1.sigma
        )

        return Measured(load, abs(load) * relative)

    def _carried(
        self, c: float, tan_phi: float, k: float, theta_1: float, slip: float, sigma_m: float
    ) -> float:
        """W [N] for a peak stress σₘ [Pa]."""
        if self._closed is not None:
            known = self._closed.load(c, tan_phi, k, theta_1, slip, sigma_m, self._exponent_error)
            if known is not None:
                return known
        shift = self._at(k, theta_1, slip)
        return scalar.load(self._wheel, c, tan_phi, k, theta_1, slip, sigma_m, shift)


def _compiled(wheel: Wheel, shift: IntegralShift | None) -> arithmetic.Closed | None:
    """The compiled closed forms, where they were built and the wheel is of plain numbers."""
    if not arithmetic.BUILT:
        return None
    numbers = (float(wheel.radius), float(wheel.width), float(wheel.c1), float(wheel.c2))
    if shift is None:
        return arithmetic.Closed(Quantity, numbers, 0.0, THETA_1, SLIP, None)
    return arithmetic.Closed(Quantity, numbers, shift.ln_k, THETA_1, SLIP, shift.coefficients)


def _shift(settings: Settings, chain: Chain) -> IntegralShift | None:
    """The shift of the integrals, if the true stresses or a contact effect are configured."""
    share = sum(e.share for e in chain.effects if isinstance(e, StressLinearisation))
    shaping = tuple(
        e for e in chain.effects if e.stage in ("contact", "soil", "wheel") and not e.filter_only
    )
    if not share and not shaping:
        return None

    soil = settings.soil
    prior = Soil(
        soil.cohesion.value,
        soil.tan_phi.value,
        soil.shear_modulus.value,
        soil.exponent.value,
        soil.pressure_sinkage.modulus(settings.wheel.width),
    )

    return IntegralShift(chain.wheel, prior, shaping, share)
