"""Torque that motor, gear and bearings consume. Friction is dynamic: bristles that bend and slip
(LuGre), or blocks that slip one after the other (Maxwell).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene

BRISTLE = 2e-3  # [rad] the wheel turns before the bristles slip
BLOCKS = np.array((0.5e-3, 2e-3, 6e-3))  # [rad] after which each block slips
CREEP = 1e-4  # [rad/s] below which a wheel stands


def lugre(omega: Array, level: Array, step: float) -> Array:
    """Friction torque (n,) at level g(ω) (n,): ż = ω − |ω| z/z₀, T = g z/z₀, exact over each step.

    Source: Canudas de Wit, Olsson, Åström, Lischinsky (1995), IEEE Trans. Automatic Control 40,
    419-425, without its micro-damping.
    """
    bent, shares = 0.0, []
    for speed in omega.tolist():
        fading = float(np.exp(-abs(speed) * step / BRISTLE))
        bent = fading * bent + (1.0 - fading) * (1.0 if speed > 0.0 else -1.0)
        shares.append(bent)

    return np.asarray(level * np.array(shares))


def maxwell(omega: Array, level: Array, step: float) -> Array:
    """Friction torque (n,) of blocks in parallel, each on a spring that gives way at its own angle.

    Source: generalised Maxwell-slip model, Al-Bender, Lampaert, Swevers (2005), IEEE Trans.
    Automatic Control 50, 1883-1887, without its creep.
    """
    state, shares = np.zeros(BLOCKS.size), []
    for turned in (omega * step).tolist():
        state = np.clip(state + turned / BLOCKS, -1.0, 1.0)
        shares.append(float(state.mean()))
    return np.asarray(level * np.array(shares))


@dataclass(frozen=True)
class BristleFriction(PlantEffect):
    """LuGre at a constant level T_C."""

    name, most = "coulomb_friction", 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.6 * facts.torque)

    def loss(self, scene: Scene) -> Array:
        """Friction torque (n,) at the axle [N·m]: `lugre` at T_C."""
        omega = scene.motion.omega
        return lugre(omega, np.full(omega.size, self.strength), scene.motion.step)

    def coinciding(self) -> dict[str, float]:
        return {"loss": self.strength}


@dataclass(frozen=True)
class BlockFriction(PlantEffect):
    """Maxwell's blocks at a level T_C that varies by a twentieth once a turn, as seals do."""

    phase: float = 0.0

    name, most = "coulomb_friction", 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.6 * facts.torque, float(rng.uniform(0.0, 2.0 * np.pi)))

    def loss(self, scene: Scene) -> Array:
        """Friction torque (n,) at the axle [N·m]: `maxwell` at T_C (1 + cos(ψ + phase)/20)."""
        level = self.strength * (1.0 + 0.05 * np.cos(scene.motion.turn + self.phase))
        return maxwell(scene.motion.omega, level, scene.motion.step)

    def coinciding(self) -> dict[str, float]:
        return {"loss": self.strength}


@dataclass(frozen=True)
class ThinningGrease(PlantEffect):
    """B ω (1 + |ω|/ω₁)^(−0.2): grease that thins a little. Source: Carreau-type shear thinning."""

    thinning: float = 1.0  # ω₁ [rad/s]

    name, most = "viscous_friction", 2.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.6 * facts.torque / facts.omega, float(rng.uniform(1.0, 3.0)) * facts.omega)

    def loss(self, scene: Scene) -> Array:
        """B ω (1 + |ω|/ω₁)^(−0.2) (n,) at the axle [N·m]."""
        omega = scene.motion.omega
        return np.asarray(self.strength * omega * (1.0 + np.abs(omega) / self.thinning) ** -0.2)


@dataclass(frozen=True)
class FloodedBearings(PlantEffect):
    """B ω₀ sign(ω) |ω/ω₀|^(2/3).

    Source: speed term of Palmgren (1959), Ball and Roller Bearing Engineering, 3rd ed.
    """

    usual: float = 0.3  # ω₀ [rad/s]

    name, most = "viscous_friction", 2.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.6 * facts.torque / facts.omega, facts.omega)

    def loss(self, scene: Scene) -> Array:
        """B ω₀ sign(ω) |ω/ω₀|^(2/3) (n,) at the axle [N·m]."""
        rate = np.abs(scene.motion.omega) / self.usual
        return np.asarray(
            self.strength * self.usual * np.sign(scene.motion.omega) * rate ** (2.0 / 3.0)
        )


@dataclass(frozen=True)
class LorentzStribeck(PlantEffect):
    """LuGre at the level T_S/(1 + (ω/ω_S)²) above the Coulomb one.

    Source: Lorentzian form of the Stribeck curve, Hess and Soom (1990), J. Tribology 112, 147-152.
    """

    speed: float = 0.15  # ω_S [rad/s]

    name, most = "stribeck_friction", 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.8 * facts.torque, float(rng.uniform(0.4, 1.0)) * facts.omega)

    def loss(self, scene: Scene) -> Array:
        """Friction torque (n,) at the axle [N·m]: `lugre` at T_S/(1 + (ω/ω_S)²)."""
        omega = scene.motion.omega
        return lugre(omega, self.strength / (1.0 + (omega / self.speed) ** 2), scene.motion.step)


@dataclass(frozen=True)
class ExponentialStribeck(PlantEffect):
    """Maxwell's blocks at the level T_S e^(−|ω|/ω_S).

    Source: exponential form of the falling curve, Tustin (1947), J. IEE 94(IIA), 143-151.
    """

    speed: float = 0.15  # ω_S [rad/s]

    name, most = "stribeck_friction", 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.9 * facts.torque, float(rng.uniform(0.4, 1.0)) * facts.omega)

    def loss(self, scene: Scene) -> Array:
        """Friction torque (n,) at the axle [N·m]: `maxwell` at T_S e^(−|ω|/ω_S)."""
        omega = scene.motion.omega
        return maxwell(
            omega, self.strength * np.exp(-np.abs(omega) / self.speed), scene.motion.step
        )


@dataclass(frozen=True)
class OneSidedGear(PlantEffect):
    """The gear loses A more than its calibrated mean forward, 0.9 A less backward, at rest what it
    lost last.
    """

    name, signed, most = "asymmetric_friction", True, 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.4 * facts.torque * cls.sign(rng))

    def loss(self, scene: Scene) -> Array:
        """Torque (n,) at the axle [N·m] by `lugre`, of the sign of A: A forward, 0.9 A backward."""
        omega = scene.motion.omega
        return (
            np.abs(lugre(omega, np.where(omega > 0.0, 1.0, 0.9), scene.motion.step)) * self.strength
        )

    def coinciding(self) -> dict[str, float]:
        return {"difference": self.strength}


@dataclass(frozen=True)
class ThrustedGear(PlantEffect):
    """Helical teeth push the shaft on another bearing by direction: A (¾ + ¼ |T|/T₀) more forward,
    as much less backward.

    Source: axial force of helical gears in proportion to the torque; the shares were chosen here.
    """

    torque: float = 1.5  # T₀ [N·m]

    name, signed, most = "asymmetric_friction", True, 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.4 * facts.torque * cls.sign(rng), facts.torque)

    def loss(self, scene: Scene) -> Array:
        """Torque (n,) at the axle [N·m] by `maxwell`, of the sign of A both ways."""
        pushed = 0.75 + 0.25 * np.abs(scene.torque) / self.torque
        turning = np.abs(maxwell(scene.motion.omega, np.ones(pushed.size), scene.motion.step))
        return np.asarray(self.strength * pushed * turning)


@dataclass(frozen=True)
class LoadedBearing(PlantEffect):
    """a W₀ (W/W₀)^1.4 against rotation, at a radius r: pressed balls roll harder.

    Source: load term of Palmgren (1959), Ball and Roller Bearing Engineering, 3rd ed., with the
    exponent of ball bearings.
    """

    lever: float = 0.07  # r [m]
    weight: float = 60.0  # W₀ [N]

    name, most = "load_dependent_friction", 0.15

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.radius, facts.weight)

    def loss(self, scene: Scene) -> Array:
        """Friction torque (n,) at the axle [N·m]: `lugre` at a r W₀ (W/W₀)^1.4."""
        pressed = np.maximum(scene.carried, 0.0) / self.weight
        level = self.strength * self.lever * self.weight * pressed**1.4
        return lugre(scene.motion.omega, level, scene.motion.step)


@dataclass(frozen=True)
class PlainBearing(PlantEffect):
    """a √(W² + DP²) r against rotation, falling by a tenth a decade of speed: a bush feels all of
    the axle's force.

    Source: Amontons' law on the resultant; the fall with speed was chosen here.
    """

    lever: float = 0.07  # r [m]

    name, most = "load_dependent_friction", 0.15

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.radius)

    def loss(self, scene: Scene) -> Array:
        """Friction torque (n,) at the axle [N·m]: `maxwell` at a r √(W² + DP²) (|ω|/ω₀)^(−0.04),
        with ω₀ = 0.3 rad/s.
        """
        pressed = np.hypot(np.maximum(scene.carried, 0.0), scene.pull)
        speed = np.abs(scene.motion.omega) + CREEP
        level = self.strength * self.lever * pressed * (speed / 0.3) ** -0.04
        return maxwell(scene.motion.omega, level, scene.motion.step)


EFFECTS: tuple[type[PlantEffect], ...] = (
    BristleFriction,
    BlockFriction,
    ThinningGrease,
    FloodedBearings,
    LorentzStribeck,
    ExponentialStribeck,
    OneSidedGear,
    ThrustedGear,
    LoadedBearing,
    PlainBearing,
)
