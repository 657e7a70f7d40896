"""What a world has of its own: there in every campaign of it, and not what is asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.tools.proof.blind.plant.concealed.friction import lugre
from gritd.tools.proof.blind.plant.concealed.travel import relaxed, steps_of
from gritd.tools.proof.blind.plant.contact import Rim
from gritd.tools.proof.blind.plant.effect import PlantEffect
from gritd.tools.proof.blind.plant.memory import lagged, mean_before
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene

USUAL = 0.5  # sin θ₁ at which a relaxation has its stated length
SHALLOW, DEEP = 0.05, 0.5 * np.pi  # θ₁ [rad] within which it goes with the contact


@dataclass(frozen=True)
class BottomPeak(PlantEffect):
    """Stress peaks near the bottom, θₘ/θ₁ = strength + slope √i, and the soil springs back."""

    slope: float = 0.1
    rebound: float = 0.1  # share of the sinkage

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        peak = self.strength + self.slope * np.sqrt(np.clip(scene.slip, 0.0, 1.0))
        return replace(rim, peak=peak, rebound=self.rebound)


@dataclass(frozen=True)
class Relaxation(PlantEffect):
    """Torque and pull follow over the length of the contact, `strength` [m] at an entry angle of
    30° and more where the wheel is deeper; the sinkage over as much and more.

    By two lags of half the length one after the other, or as means over twice the length.
    """

    deeper: float = 1.5  # length of the sinkage over that of the forces
    even: bool = False  # means

    def forces(self, scene: Scene) -> Scene:
        way = steps_of(scene) * USUAL / np.sin(np.clip(scene.theta_1, SHALLOW, DEEP))
        late = relaxed(scene, lambda values: self._late(values, way, self.strength))
        slow = relaxed(scene, lambda values: self._late(values, way, self.strength * self.deeper))
        return replace(late, sinkage=slow.sinkage)

    def _late(self, values: Array, way: Array, length: float) -> Array:
        if self.even:
            return mean_before(values, np.cumsum(way), 2.0 * length)
        return lagged(lagged(values, way, 0.5 * length), way, 0.5 * length)


@dataclass(frozen=True)
class WornGear(PlantEffect):
    """The gear takes a share of the torque (`strength`) and a level, and its teeth are felt."""

    level: float = 0.1  # [N·m]
    ripple: float = 0.05  # [N·m]
    order: int = 30
    phase: float = 0.0

    def loss(self, scene: Scene) -> Array:
        """Friction and ripple of the teeth together (n,), at the axle [N·m]."""
        motion, angle = scene.motion, self.order * scene.motion.turn + self.phase
        teeth = self.ripple * (np.cos(angle) + 0.4 * np.cos(3.0 * angle + 1.0)) * scene.moving
        level = self.level + self.strength * np.abs(scene.torque)
        return np.asarray(lugre(motion.omega, level, motion.step) + teeth)


@dataclass(frozen=True)
class LeakingSensor(PlantEffect):
    """Load and torque leak into the pull, the pull into load and torque; `strength`: the load's."""

    torque: float = 0.0  # of the torque into the pull [1/m]
    back: float = 0.0  # of the pull into the load
    lever: float = 0.0  # of the pull into the torque [m]

    def sensed(self, felt: Felt) -> Felt:
        return felt.read(
            pull=felt.pull + self.strength * felt.load + self.torque * felt.torque,
            load=felt.load + self.back * felt.pull,
            torque=felt.torque + self.lever * felt.pull,
        )
