"""Soil pushed ahead of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Reaction
from gritd.estimator.terramechanics.earth_pressure import blade_resistance


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
        z = np.maximum(situation.sinkage, 0.0)
        area, moment = situation.width * z, 0.5 * situation.width * z**2
        soil = situation.cohesion, situation.tan_phi, self.unit_weight
        resistance = self.share * blade_resistance(area, moment, *soil)
        return replace(
            reaction, drawbar_pull=reaction.drawbar_pull - situation.direction * resistance
        )
