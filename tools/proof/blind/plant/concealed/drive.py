"""Effects of motor and gear. Friction is dynamic: bristles that bend and slip (LuGre)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene

BRISTLE = 2e-3  # [rad] the wheel turns before the bristles slip


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


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """LuGre at a constant level T_C."""

    name, most = "coulomb_friction", 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.6 * facts.torque)

    def loss(self, scene: Scene) -> Array:
        omega = scene.motion.omega
        return lugre(omega, np.full(omega.size, self.strength), scene.motion.step)

    def coinciding(self) -> dict[str, float]:
        return {"loss": self.strength}


@dataclass(frozen=True)
class ViscousFriction(Effect):
    """B ω (1 + |ω|/ω₁)^(−0.2): grease that thins a little. Source: Carreau-type shear thinning."""

    thinning: float = 1.0  # ω₁ [rad/s]

    name, most = "viscous_friction", 2.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.6 * facts.torque / facts.omega, float(rng.uniform(1.0, 3.0)) * facts.omega)

    def loss(self, scene: Scene) -> Array:
        omega = scene.motion.omega
        return np.asarray(self.strength * omega * (1.0 + np.abs(omega) / self.thinning) ** -0.2)


@dataclass(frozen=True)
class StribeckFriction(Effect):
    """LuGre at the level T_S/(1 + (ω/ω_S)²) above the Coulomb one.

    Source: Lorentzian form of the Stribeck curve, Hess and Soom (1990), J. Tribology 112, 147-152.
    """

    speed: float = 0.15  # ω_S [rad/s]

    name, most = "stribeck_friction", 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.8 * facts.torque, float(rng.uniform(0.4, 1.0)) * facts.omega)

    def loss(self, scene: Scene) -> Array:
        omega = scene.motion.omega
        return lugre(omega, self.strength / (1.0 + (omega / self.speed) ** 2), scene.motion.step)


@dataclass(frozen=True)
class AsymmetricFriction(Effect):
    """The gear loses A more than its calibrated mean forward, 0.9 A less backward, nothing at rest."""

    name, signed, most = "asymmetric_friction", True, 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.4 * facts.torque * cls.sign(rng))

    def loss(self, scene: Scene) -> Array:
        omega = scene.motion.omega
        return (
            np.abs(lugre(omega, np.where(omega > 0.0, 1.0, 0.9), scene.motion.step)) * self.strength
        )

    def coinciding(self) -> dict[str, float]:
        return {"difference": self.strength}


@dataclass(frozen=True)
class GearRipple(Effect):
    """A tooth-mesh ripple with its second harmonic. Source: transmission error of a spur gear is no
    pure sine.
    """

    order: int = 24
    phase: float = 0.0
    second: float = 0.3

    name, most = "gear_ripple", 0.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        phase = float(rng.uniform(0.0, 2.0 * np.pi))
        return cls(
            0.3 * facts.torque, int(rng.integers(6, 50)), phase, float(rng.uniform(0.0, 0.4))
        )

    def loss(self, scene: Scene) -> Array:
        angle = self.order * scene.motion.turn + self.phase
        moving = scene.moving
        return np.asarray(
            self.strength * (np.cos(angle) + self.second * np.cos(2.0 * angle + 1.0)) * moving
        )


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Winding and housing, each with its temperature; the magnets follow the housing, the flux
    falls with them.

    τ₁ u̇ = I² (1 + ρ u) − (u − w), τ₂ ẇ = (u − w) − w/2; K_t falls by β (0.3 u + 0.7 w) of itself.
    u, w in A².
    Source: two-body thermal network, Hendershot and Miller (2010), Design of Brushless
        Permanent-Magnet Machines.
    """

    winding: float = 15.0  # τ₁ [s]
    housing: float = 90.0  # τ₂ [s]

    name, most = "motor_heating", 0.1

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        fall = 0.25 / max(facts.current, 0.1) ** 2
        return cls(fall, float(rng.uniform(8.0, 25.0)), float(rng.uniform(60.0, 200.0)))

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        step, winding, housing, drawn = scene.motion.step, 0.0, 0.0, []
        for wanted in current.tolist():
            flux = 1.0 - self.strength * (0.3 * winding + 0.7 * housing)
            amperes = wanted / max(flux, 0.2)
            copper = amperes**2 * (1.0 + 0.1 * self.strength * winding)
            winding += step / self.winding * (copper - (winding - housing))
            housing += step / self.housing * ((winding - housing) - 0.5 * housing)
            drawn.append(amperes)
        return np.array(drawn)


@dataclass(frozen=True)
class TorqueConstantError(Effect):
    """The torque per ampere is K_t (1 + e) while the motor drives; e < 0 is a gear that loses a
    share.
    """

    name, signed, most = "torque_constant_error", True, 0.3

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        return current / (1.0 + self.strength)

    def coinciding(self) -> dict[str, float]:
        return {"error": self.strength}


EFFECTS: tuple[type[Effect], ...] = (
    CoulombFriction,
    ViscousFriction,
    StribeckFriction,
    AsymmetricFriction,
    GearRipple,
    MotorHeating,
    TorqueConstantError,
)
