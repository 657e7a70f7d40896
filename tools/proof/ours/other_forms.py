"""Listed physics in other published forms, for trials: the name must survive a formula that is not
ours.

The class's `stands_for` is the name the diagnosis should give.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, turning
from gritd.estimator.stages.situation import ContactLaw, Reaction, Sensed, Situation
from gritd.estimator.terramechanics.soil import Array, Scalar, Soil


def _size(typical: float, low: float = 0.0) -> float:
    return strength("size", "", typical=typical, low=low, high=1e6)  # type: ignore[no-any-return]


class Cousin(Effect):
    """Another form of a listed effect."""

    stands_for: ClassVar[str]
    fingerprint = Fingerprint("torque", "constant", "")


@dataclass(frozen=True)
class SweptSlipSinkage(Cousin):
    """Sinkage grows as −h ln(1 − i): every part of the rim that passes takes a layer with it."""

    size: float = _size(3e-3)
    stage = "wheel"
    stands_for = "slip_sinkage"

    def wheel(self, reaction: Reaction, situation: Situation) -> Reaction:
        slip = np.clip(situation.slip, 0.0, 0.8)
        return replace(reaction, sinkage=reaction.sinkage - self.size * np.log(1.0 - slip))


@dataclass(frozen=True)
class LorentzStribeck(Cousin):
    """Break-away friction as T_S/(1 + (ω/ω_S)²) (Hess and Soom 1990)."""

    size: float = _size(0.6)
    stage = "drivetrain"
    stands_for = "stribeck_friction"

    def torque_loss(self, situation: Situation) -> Scalar:
        return (
            self.size / (1.0 + (situation.wheel_speed / 0.12) ** 2) * turning(situation.wheel_speed)
        )


@dataclass(frozen=True)
class PowerViscous(Cousin):
    """Grease whose loss grows as ω^0.8."""

    size: float = _size(0.8)
    stage = "drivetrain"
    stands_for = "viscous_friction"

    def torque_loss(self, situation: Situation) -> Scalar:
        return self.size * np.sign(situation.wheel_speed) * np.abs(situation.wheel_speed) ** 0.8


@dataclass(frozen=True)
class PowerRateShear(Cousin):
    """Strength grows as (v/v₀)^m."""

    size: float = _size(0.04)
    stage = "contact"
    stands_for = "rate_dependent_shear"

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        rim = situation.radius * np.abs(situation.wheel_speed) + 1e-3
        return replace(law, strength=law.strength * (rim / 0.02) ** self.size)


@dataclass(frozen=True)
class LinearDrying(Cousin):
    """Cohesion drifts in proportion to time."""

    size: float = _size(0.4, low=-1.0)
    stage = "soil"
    stands_for = "drying_cohesion"

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        return replace(
            soil,
            cohesion=soil.cohesion * np.maximum(1.0 + self.size * situation.time / 400.0, 0.05),
        )


@dataclass(frozen=True)
class LogMultipass(Cousin):
    """Modulus grows with the logarithm of the pass."""

    size: float = _size(0.3)
    stage = "soil"
    stands_for = "multipass"

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        return replace(
            soil, modulus=soil.modulus * (1.0 + self.size * np.log(situation.pass_number))
        )


@dataclass(frozen=True)
class PlainBulldozing(Cousin):
    """Passive earth pressure of the sinkage without cohesion: ½ γ b z² N."""

    size: float = _size(3.0)
    stage = "wheel"
    stands_for = "bulldozing"

    def wheel(self, reaction: Reaction, situation: Situation) -> Reaction:
        wedge = 0.5 * 15e3 * situation.width * situation.sinkage**2 * 3.0
        return replace(
            reaction, drawbar_pull=reaction.drawbar_pull - self.size * wedge * situation.direction
        )


@dataclass(frozen=True)
class QuadraticHeating(Cousin):
    """Torque constant falls with the energy lost so far."""

    size: float = _size(0.05)
    stage = "drivetrain"
    stands_for = "motor_heating"

    def torque_factor(self, situation: Situation) -> Scalar:
        step = np.diff(situation.time, prepend=np.ravel(situation.time)[:1])
        return 1.0 / (1.0 + self.size * np.cumsum(situation.current**2 * step) / 30.0)


@dataclass(frozen=True)
class HumpedShear(Cousin):
    """A peak of the shear strength whose excess decays over three shear moduli."""

    size: float = _size(0.4)
    stage = "contact"
    stands_for = "shear_peak"

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        settled = law.mobilisation

        def humped(x: Array) -> Array:
            return np.asarray(settled(x) * (1.0 + self.size * np.exp(-np.abs(x) / 3.0)))

        return replace(law, mobilisation=humped)


@dataclass(frozen=True)
class SlippingRearContact(Cousin):
    """Contact behind the wheel that slip digs away."""

    size: float = _size(0.25)
    stage = "contact"
    stands_for = "rear_contact"

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        return replace(
            law, theta_2_ratio=law.theta_2_ratio + self.size * (1.0 - 0.7 * np.abs(situation.slip))
        )


@dataclass(frozen=True)
class StiffeningFrame(Cousin):
    """A frame with play, that yields as W^0.6."""

    size: float = _size(1e-3)
    stage = "testbed"
    stands_for = "frame_compliance"

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(
            sensed, sinkage=sensed.sinkage + self.size * (np.abs(situation.carried) / 70.0) ** 0.6
        )


@dataclass(frozen=True)
class SaturatingRateSinkage(Cousin):
    """Stiffening with speed that levels off."""

    size: float = _size(0.15, low=-1.0)
    stage = "soil"
    stands_for = "rate_dependent_sinkage"

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        rim = situation.radius * np.abs(situation.wheel_speed)
        return replace(soil, modulus=soil.modulus * (1.0 + self.size * (rim - 0.02) / (rim + 0.02)))


@dataclass(frozen=True)
class LevellingPeakShift(Cousin):
    """θₘ/θ₁ that grows with slip and levels off."""

    size: float = _size(0.1, low=-1.0)
    stage = "contact"
    stands_for = "stress_peak_shift"

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        return replace(
            law, theta_m_ratio=law.theta_m_ratio + self.size * (0.5 + np.tanh(3.0 * situation.slip))
        )


COUSINS: tuple[type[Cousin], ...] = (
    SweptSlipSinkage, LorentzStribeck, PowerViscous, PowerRateShear, LinearDrying, LogMultipass,
    PlainBulldozing, QuadraticHeating, HumpedShear, SlippingRearContact, StiffeningFrame,
    SaturatingRateSinkage, LevellingPeakShift,
)  # fmt: skip
