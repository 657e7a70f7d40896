"""Soil pushed ahead of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Reaction


@dataclass(frozen=True)
class Bulldozing(Effect):
    """The wheel pushes a wedge of soil ahead of it, which takes from the drawbar pull alone.

    R = s b [cot X + tan(X + φ)] [c z + γ z²/2 (cot X + cot² X / cot φ)],   X = 45° − φ/2;   DP − R

    Source: Hegedus (1960), Land Locomotion Laboratory Report 61, as given by Ishigami et al.
    (2007), J. Field Robotics 24, 233-250, there for the sides of a wheel; s = 1 is a plane blade as
    wide as the wheel.
    """

    share: float = strength(
        "share of a plane blade's resistance, s", "", typical=0.3, low=0.0, high=5.0
    )
    unit_weight: float = shape(
        "weight of the soil, γ", "N/m^3", mean=15e3, sigma=2e3, low=1e3, high=25e3
    )

    stage = "wheel"
    fingerprint = Fingerprint(
        "drawbar_pull", "sinkage", "drawbar pull falls with sinkage while torque and sinkage stay"
    )
    confusable_with = told_apart(
        side_wall_rubbing="load_step", bed_slope="reversal", force_crosstalk="reversal"
    )

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        z, phi = np.maximum(situation.sinkage, 0.0), np.arctan(situation.tan_phi)
        x = 0.25 * np.pi - 0.5 * phi
        cot_x = 1.0 / np.tan(x)
        wedge = situation.cohesion * z + 0.5 * self.unit_weight * z**2 * (
            cot_x + cot_x**2 * situation.tan_phi
        )
        resistance = self.share * situation.width * (cot_x + np.tan(x + phi)) * wedge
        return replace(
            reaction, drawbar_pull=reaction.drawbar_pull - situation.direction * resistance
        )
