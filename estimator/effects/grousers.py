"""Lugs on the rim."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, Parameter, shape, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Reaction, Situation, dug_by_slip
from gritd.estimator.terramechanics.soil import Wheel

RIPPLE = ("ripple_cos", "ripple_sin", "count")


@dataclass(frozen=True)
class Grousers(Effect):
    """Lugs on the rim shear the soil at a larger radius, grip, carry soil away as they slip, and
    make N ripples a turn.

    r_s = r + λ h;  (c, tan φ) · (1 + g);  z + d i/(1 − i), i from 0 to 0.95;
    q = a cos Nψ + b sin Nψ;  T(1 + q),  DP + qT/r,  z − q h;   ψ wheel angle

    Source: shearing radius Ding, Gao, Deng, Nagatani, Yoshida (2011), J. Terramechanics 48, 27-45;
    ripple Skonieczny, Moreland, Wettergreen (2012), IEEE/RSJ IROS; soil-to-soil against
    soil-to-metal friction Wong (2008), section 2.4.
    Lugs that carry the soil between them away: i/(1 − i) is attributed to Reece (1965), whose paper
    was not at hand; d = h where all of it is carried.
    """

    height: float = strength("height of the lugs, h", "m", typical=5e-3, low=0.0, high=0.06)
    grip: float = strength(
        "gain of shear strength over the smooth rim, g", "", typical=0.15, low=0.0, high=2.0
    )
    ripple_cos: float = strength(
        "relative ripple of torque in phase, a", "", typical=0.15, low=-0.5, high=0.5
    )
    ripple_sin: float = strength(
        "relative ripple of torque in quadrature, b", "", typical=0.15, low=-0.5, high=0.5
    )
    digging: float = strength(
        "height of the soil that the lugs carry away, d", "m", typical=2e-3, low=0.0, high=0.06
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
        wheel_eccentricity="lifted_spin",
        wheel_radius_error="tape",
        slip_sinkage="smooth_wheel",
    )

    @classmethod
    def in_steady_states(cls) -> type[Effect]:
        return GrousersInMeans

    def geometry(self, wheel: Wheel) -> Wheel:
        return replace(wheel, radius=wheel.radius + self.share * self.height)

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        return replace(law, strength=law.strength * (1.0 + self.grip))

    def wheel(self, reaction: Reaction, situation: Situation) -> Reaction:
        phase = self.count * situation.wheel_angle
        ripple = self.ripple_cos * np.cos(phase) + self.ripple_sin * np.sin(phase)
        return replace(
            reaction,
            torque=reaction.torque + ripple * situation.torque,
            drawbar_pull=reaction.drawbar_pull + ripple * situation.torque / situation.radius,
            sinkage=reaction.sinkage
            - ripple * self.height
            + self.digging * dug_by_slip(situation.slip),
        )


class GrousersInMeans(Grousers):
    """The lugs of a wheel of which only steady means were measured: no ripple, so no count."""

    fingerprint = Fingerprint("drawbar_pull", "slip", "more pull; deeper at high slip")

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(p for p in super().parameters() if p.name not in RIPPLE)
