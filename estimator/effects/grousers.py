"""Lugs on the rim."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, Parameter, shape, strength, told_apart
from gritd.estimator.stages.situation import Balanced, ContactLaw, Reaction, Situation, dug_by_slip
from gritd.estimator.terramechanics.soil import Soil, Wheel

RIPPLE = ("ripple_cos", "ripple_sin", "lift_cos", "lift_sin", "count")
SMOOTH_TOO = ("rise", "growth")  # of a smooth wheel: `sinkage_datum`, `slip_sinkage`


@dataclass(frozen=True)
class Grousers(Effect):
    """Lugs on the rim shear the soil at a larger radius, grip, carry soil away as they slip, and
    make N ripples a turn.

    r_s = r + λ h;  (c, tan φ) · (1 + g);  n + n₁ |i|;
    q = a cos Nψ + b sin Nψ;  T(1 + q),  DP + qT/r;   ψ wheel angle
    z + d i/(1 − i) − e − (l cos Nψ + m sin Nψ),  i from 0 to 0.95

    The wheel rises over a lug at another angle than that at which the lug pushes most, and by a
    length that hardly depends on the load: sinkage ripples with a phase and size of its own. Where
    the zero of sinkage was set with the lugs on, e is negative: the rim begins above the soil.
    Lugs that carry the soil between them away dig d deeper; d = h where all of it is carried.

    Source: shearing radius and n₁ of wheels with lugs Ding, Gao, Deng, Nagatani, Yoshida (2011),
    J. Terramechanics 48, 27-45; ripple Skonieczny, Moreland, Wettergreen (2012), IEEE/RSJ IROS;
    soil-to-soil against soil-to-metal friction Wong (2008), section 2.4; i/(1 − i) is attributed to
    Reece (1965), whose paper was not at hand.
    """

    height: float = strength("height of the lugs, h", "m", typical=5e-3, low=0.0, high=0.06)
    grip: float = strength(
        "gain of shear strength over the smooth rim, g", "", typical=0.2, low=0.0, high=2.0
    )
    ripple_cos: float = strength(
        "relative ripple of torque in phase, a", "", typical=0.15, low=-0.5, high=0.5
    )
    ripple_sin: float = strength(
        "relative ripple of torque in quadrature, b", "", typical=0.15, low=-0.5, high=0.5
    )
    lift_cos: float = strength(
        "rise over a lug in phase, l", "m", typical=5e-5, low=-0.01, high=0.01
    )
    lift_sin: float = strength(
        "rise over a lug in quadrature, m", "m", typical=5e-5, low=-0.01, high=0.01
    )
    rise: float = strength(
        "height by which the lugs carry the rim, e", "m", typical=5e-4, low=-0.06, high=0.06
    )
    digging: float = strength(
        "height of the soil that the lugs carry away, d", "m", typical=1e-3, low=0.0, high=0.06
    )
    growth: float = strength(
        "rise of the sinkage exponent with slip, n₁", "", typical=0.1, low=0.0, high=2.5
    )
    count: float = shape(
        "lugs on the rim, N", "", mean=16.0, sigma=8.0, low=4.0, high=60.0, scan=True
    )
    share: float = shape(
        "share of the height that shears, λ", "", mean=0.6, sigma=0.2, low=0.0, high=1.0
    )

    stage = "wheel"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "wheel_angle",
        "N ripples a turn in drawbar pull, torque and sinkage; more pull; deeper at high slip",
    )
    confusable_with = told_apart(
        gear_ripple="load_step",
        wheel_eccentricity="load_step",
        wheel_radius_error="tape",
        slip_sinkage="smooth_wheel",
    )

    @classmethod
    def in_steady_states(cls) -> type[Effect]:
        return GrousersInMeans

    def geometry(self, wheel: Wheel) -> Wheel:
        return replace(wheel, radius=wheel.radius + self.share * self.height)

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        return replace(soil, exponent=soil.exponent + self.growth * np.abs(situation.slip))

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        return replace(law, strength=law.strength * (1.0 + self.grip))

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        phase = self.count * situation.wheel_angle
        ripple = self.ripple_cos * np.cos(phase) + self.ripple_sin * np.sin(phase)
        lift = self.lift_cos * np.cos(phase) + self.lift_sin * np.sin(phase)
        dug = self.digging * dug_by_slip(situation.slip)
        return replace(
            reaction,
            torque=reaction.torque + ripple * situation.torque,
            drawbar_pull=reaction.drawbar_pull + ripple * situation.torque / situation.radius,
            sinkage=reaction.sinkage + dug - self.rise - lift,
        )


class GrousersInMeans(Grousers):
    """The lugs of a wheel of which only steady means were measured: no ripple, so no count, and
    nothing that a smooth wheel has too.
    """

    fingerprint = Fingerprint("drawbar_pull", "slip", "more pull; deeper at high slip")

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(p for p in super().parameters() if p.name not in RIPPLE + SMOOTH_TOO)
