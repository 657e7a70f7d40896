"""What the filter expects the sensors to say: the closed forms, with the configured effects applied
to them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
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


class PredictedQuantity(NamedTuple):
    """A predicted force or torque and its gradient, SI."""

    value: float
    by_c: float  # [1/Pa]
    by_tan_phi: float
    by_ln_k: float
    by_theta_1: float
    by_slip: float
    by_load: float
    by_exponent: float  # n
    by_peak: float  # θₘ/θ₁


class FormError(NamedTuple):
    """What is added to the configured shape of the stresses."""

    exponent: float = 0.0  # n
    c1: float = 0.0  # of θₘ = (c₁ + c₂ i) θ₁
    c2: float = 0.0


AS_CONFIGURED = FormError()


class ForcePrediction(NamedTuple):
    torque: PredictedQuantity  # T [N·m]
    drawbar_pull: PredictedQuantity  # DP [N]
    resistance: PredictedQuantity  # [N]


class WheelModel:
    """Eqs. (20)-(22) for one wheel, σₘ eliminated through (21)."""

    def __init__(self, settings: Settings, chain: Chain) -> None:
        self._wheel = chain.wheel
        self._soil = settings.soil
        self._modulus = settings.soil.pressure_sinkage.modulus(settings.wheel.width)
        self._shift = _shift(settings, chain)
        self._closed = _compiled(self._wheel, self._shift)

    def predict(
        self,
        c: float,
        tan_phi: float,
        k: float,
        theta_1: float,
        slip: float,
        load: float,
        form: FormError = AS_CONFIGURED,
    ) -> ForcePrediction:
        """T, DP and resistance with gradients; c [Pa], k [m], θ₁ > 0 [rad], W [N]."""
        if self._closed is not None:
            known = self._closed.predict(c, tan_phi, k, theta_1, slip, load, *form)
            if known is not None:
                return ForcePrediction(*known)

        shift = self._at(k, theta_1, slip, form)
        p = scalar.predict(self._moved(form), c, tan_phi, k, theta_1, slip, load, shift)
        return ForcePrediction(
            PredictedQuantity(p.torque, *p.torque_gradient),
            PredictedQuantity(p.drawbar_pull, *p.drawbar_pull_gradient),
            PredictedQuantity(p.resistance, *p.resistance_gradient),
        )

    def _at(self, k: float, theta_1: float, slip: float, form: FormError) -> linear.Shift | None:
        return None if self._shift is None else self._shift.at(k, theta_1, slip, *form)

    def _moved(self, form: FormError) -> Wheel:
        wheel = self._wheel
        return replace(wheel, c1=wheel.c1 + form.c1, c2=wheel.c2 + form.c2)

    def load(
        self,
        c: float,
        tan_phi: float,
        k: float,
        theta_1: Measured,
        theta_m: float,
        slip: float,
        form: FormError = AS_CONFIGURED,
    ) -> Measured:
        """W [N] by Eq. (21) with σₘ of Eq. (3) and the prior moduli; its σ is that of the moduli
        and of θ₁.
        """
        radius, soil = self._wheel.radius, self._soil
        depth = radius * (cos(theta_m) - cos(theta_1.value))
        if depth <= 0.0:
            return Measured(0.0, 0.0)

        sigma_m = self._modulus * depth**soil.exponent.value
        load = self._carried(c, tan_phi, k, theta_1.value, slip, sigma_m, form)
        by_angle = soil.exponent.value * radius * sin(theta_1.value) / depth
        relative = hypot(
            soil.modulus_sigma, log(depth) * soil.exponent.sigma, by_angle * theta_1.sigma
        )

        return Measured(load, abs(load) * relative)

    def _carried(
        self,
        c: float,
        tan_phi: float,
        k: float,
        theta_1: float,
        slip: float,
        sigma_m: float,
        form: FormError,
    ) -> float:
        """W [N] for a peak stress σₘ [Pa]."""
        if self._closed is not None:
            known = self._closed.load(c, tan_phi, k, theta_1, slip, sigma_m, *form)
            if known is not None:
                return known
        shift = self._at(k, theta_1, slip, form)
        return scalar.load(self._moved(form), c, tan_phi, k, theta_1, slip, sigma_m, shift)


def _compiled(wheel: Wheel, shift: IntegralShift | None) -> arithmetic.Closed | None:
    """The compiled closed forms, where they were built and the wheel is of plain numbers."""
    if not arithmetic.BUILT:
        return None
    numbers = (float(wheel.radius), float(wheel.width), float(wheel.c1), float(wheel.c2))
    if shift is None:
        return arithmetic.Closed(PredictedQuantity, numbers, 0.0, THETA_1, SLIP, None)
    return arithmetic.Closed(
        PredictedQuantity, numbers, shift.ln_k, THETA_1, SLIP, shift.coefficients
    )


def _shift(settings: Settings, chain: Chain) -> IntegralShift | None:
    """The shift of the integrals: to the true stresses, unless `stress_linearisation` is configured
    with a share of 0, and with the contact effects.
    """
    shares = [e.share for e in chain.effects if isinstance(e, StressLinearisation)]
    share = shares[0] if shares else 1.0
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

    return _tabulated(chain.wheel, prior, shaping, share)


# one of a wheel, soil and effects: a run makes several trackers, and its table takes 0.1 s
_tabulated = lru_cache(8)(IntegralShift)
