"""Effects of motor and gear beyond friction: teeth, play, heat, and what an ampere is worth."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene

PARTS = (np.arange(32) + 0.5) / 32  # of a step of time
STANDING = 1e-4  # [rad/s] below which the direction is not taken to have changed


@dataclass(frozen=True)
class GearTeeth(PlantEffect, ABC):
    """A ripple at the order of a tooth mesh; its forms give the wave."""

    order: int = 24
    phase: float = 0.0
    second: float = 0.3

    name, most = "gear_ripple", 0.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        phase, second = float(rng.uniform(0.0, 2.0 * np.pi)), float(rng.uniform(0.0, 0.4))
        return cls(0.3 * facts.torque, int(rng.integers(6, 75)), phase, second)

    @abstractmethod
    def wave(self, angle: Array) -> Array:
        """Ripple of unit size at a phase (n,) [rad] of the teeth."""

    def loss(self, scene: Scene) -> Array:
        """Ripple (n,) at the axle [N·m]; none at rest."""
        angle = self.order * scene.motion.turn + self.phase
        return np.asarray(self.strength * self.wave(angle) * scene.moving)


@dataclass(frozen=True)
class RoundTeeth(GearTeeth):
    """Sine and second harmonic. Source: transmission error of a spur gear is no pure sine."""

    def wave(self, angle: Array) -> Array:
        """cos φ + a cos(2φ + 1) (n,), dimensionless, at phases φ (n,) [rad]; a is `second`."""
        return np.asarray(np.cos(angle) + self.second * np.cos(2.0 * angle + 1.0))


@dataclass(frozen=True)
class CatchingTeeth(GearTeeth):
    """A saw of four harmonics: torque rises as a tooth takes over and falls when it lets go.

    Source: Fourier series of a saw; stiffness of meshing teeth steps as pairs enter and leave,
    Harris (1958), Proc. Inst. Mech. Eng. 172, 87-112.
    """

    def wave(self, angle: Array) -> Array:
        """0.8 Σ sin(kφ)/k, k = 1 … 4 (n,), dimensionless, at phases φ (n,) [rad]."""
        parts = (np.sin(k * angle) / k for k in range(1, 5))
        return np.asarray(0.8 * sum(parts, start=np.zeros(angle.size)))


@dataclass(frozen=True)
class Play(PlantEffect, ABC):
    """The gear has play b at the axle: after a reversal the motor turns b before it drives; its
    forms say how it takes up the load.
    """

    name, most = "backlash", 0.25

    @abstractmethod
    def taken_up(self, turned: Array) -> Array:
        """Share of the load that the motor feels (n,), b times `turned` (n,) after a reversal."""

    def loss(self, scene: Scene) -> Array:
        """−T (1 − share) (n,) [N·m]: what the motor does not feel of the torque T at the axle. At
        rest the teeth touch: a controller that swings back as it stops is no reversal.
        """
        if not self.strength:
            return np.zeros(scene.torque.size)
        turned, step = _since_reversal(scene.motion.omega, scene.motion.step)

        # of a step that is long against the play, its mean
        parts = [(turned - part * step) / self.strength for part in PARTS]
        share = np.mean([self.taken_up(angles) for angles in parts], axis=0)
        return np.asarray(-scene.torque * (1.0 - share) * scene.moving)


def _since_reversal(omega: Array, step: float) -> tuple[Array, Array]:
    """Angle turned since the last reversal (n,), and in the last step of time (n,), both [rad]; far
    where there was none. A reversal takes place in the middle of its step.
    """
    turning = np.where(np.abs(omega) > STANDING, np.sign(omega), 0.0)
    last, turned, angles, steps = 0.0, np.inf, [], []

    for way, angle in zip(turning.tolist(), (np.abs(omega) * step).tolist(), strict=True):
        reversed_now = bool(way and last and way != last)
        passed = 0.5 * angle if reversed_now else angle
        turned = passed if reversed_now else turned + passed
        last = way or last
        angles.append(turned)
        steps.append(passed)

    return np.array(angles), np.array(steps)


@dataclass(frozen=True)
class StrikingPlay(Play):
    """Nothing, then the teeth strike: 1.4 of the load, which dies out over a third of b.

    Source: impact at the end of a dead zone, Nordin and Gutman (2002), Automatica 38, 1633-1649;
    its size was chosen here.
    """

    def taken_up(self, turned: Array) -> Array:
        """Share of the load (n,), 0 … 1.4, at angles turned since a reversal (n,) in units of b."""
        since = np.minimum(np.maximum(turned - 1.0, 0.0), 50.0)
        return np.asarray((turned >= 1.0) * (1.0 + 0.4 * np.exp(-3.0 * since)))


@dataclass(frozen=True)
class SoftPlay(Play):
    """Teeth meet one after the other: the load comes in with the square of the angle over 1.5 b."""

    def taken_up(self, turned: Array) -> Array:
        """Share of the load (n,), 0 … 1, at angles turned since a reversal (n,) in units of b."""
        return np.asarray(np.clip(turned / 1.5, 0.0, 1.0) ** 2)


@dataclass(frozen=True)
class HousedWinding(PlantEffect):
    """Winding and housing, each with its temperature; the magnets follow the housing, the flux
    falls with them.

    τ₁ u̇ = I² (1 + ρ u) − (u − w), τ₂ ẇ = (u − w) − ½ w (w/w₀)^¼; K_t falls by β (0.3 u + 0.7 w) of
    itself. u, w in A².
    Source: two-body thermal network, Hendershot and Miller (2010), Design of Brushless
        Permanent-Magnet Machines; the housing is cooled by air that rises, Incropera et al.
        (2007), Fundamentals of Heat and Mass Transfer, 6th ed., section 9.6.
    """

    winding: float = 15.0  # τ₁ [s]
    housing: float = 90.0  # τ₂ [s]
    usual: float = 1.0  # w₀ [A²]

    name, most = "motor_heating", 0.1

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        fall = 0.25 / max(facts.current, 0.1) ** 2
        times = float(rng.uniform(8.0, 25.0)), float(rng.uniform(60.0, 200.0))
        return cls(fall, *times, max(facts.current, 0.1) ** 2)

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        """True current (n,) [A] from that of an ideal motor (n,) [A]. Both bodies are cold at
        first; of the flux a fifth is always left.
        """
        step, winding, housing, drawn = scene.motion.step, 0.0, 0.0, []

        for wanted in current.tolist():
            flux = 1.0 - self.strength * (0.3 * winding + 0.7 * housing)
            amperes = wanted / max(flux, 0.2)
            copper = amperes**2 * (1.0 + 0.1 * self.strength * winding)
            lost = 0.5 * housing * (housing / self.usual) ** 0.25
            winding += step / self.winding * (copper - (winding - housing))
            housing += step / self.housing * ((winding - housing) - lost)
            drawn.append(amperes)
        return np.array(drawn)


@dataclass(frozen=True)
class LadderedHeat(PlantEffect):
    """Heat creeps into a thick body: K_t falls by β Σ uⱼ/3, τⱼ u̇ⱼ = I² − uⱼ, τⱼ a fourth, one and
    four of τ.

    Source: Foster ladder for diffusion into a solid, whose temperature grows with the root of time,
    Carslaw and Jaeger (1959), Conduction of Heat in Solids, section 2.9.
    """

    duration: float = 60.0  # τ [s]

    name, most = "motor_heating", 0.1

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.25 / max(facts.current, 0.1) ** 2, float(rng.uniform(20.0, 80.0)))

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        """True current (n,) [A] from that of an ideal motor (n,) [A]. The body is cold at first; of
        K_t a fifth is always left.
        """
        times = self.duration * np.array((0.25, 1.0, 4.0))
        gains = -np.expm1(-scene.motion.step / times)
        warm, drawn = np.zeros(3), []

        for wanted in current.tolist():
            amperes = wanted / max(1.0 - self.strength * float(warm.mean()), 0.2)
            warm = warm + gains * (amperes**2 - warm)
            drawn.append(amperes)
        return np.array(drawn)


@dataclass(frozen=True)
class LossyGear(PlantEffect):
    """The torque per ampere is K_t (1 + e T²/(T² + T₁²)): a gear that loses a share under load,
    less of it idling. T₁ is a fifth of the usual torque.

    Source: efficiency of gears over load rises from nothing and levels off.
    """

    idle: float = 0.3  # T₁ [N·m]

    name, signed, most = "torque_constant_error", True, 0.3

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), 0.2 * facts.torque)

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        """I/(1 + e T²/(T² + T₁²)) (n,) [A] from that of an ideal motor, I (n,) [A]; T = K_t I."""
        torque = current * scene.rig.torque_constant
        loaded = torque**2 / (torque**2 + self.idle**2)
        return np.asarray(current / (1.0 + self.strength * loaded))


@dataclass(frozen=True)
class WarmMagnets(PlantEffect):
    """The torque per ampere is K_t (1 + e) at the usual current, and a twentieth of e less per
    usual current more: calibrated on another day.

    Source: armature reaction, Hendershot and Miller (2010), section on saturation, to first order.
    """

    usual: float = 0.75  # [A]

    name, signed, most = "torque_constant_error", True, 0.3

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.current)

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        """I/(1 + e (1 − m/20)) (n,) [A] from that of an ideal motor, I (n,) [A]; m = |I|/I_u − 1,
        kept within −1 … 5, I_u the usual current.
        """
        more = np.clip(np.abs(current) / self.usual - 1.0, -1.0, 5.0)
        return np.asarray(current / (1.0 + self.strength * (1.0 - 0.05 * more)))

    def coinciding(self) -> dict[str, float]:
        return {"error": self.strength}


EFFECTS: tuple[type[PlantEffect], ...] = (
    RoundTeeth,
    CatchingTeeth,
    StrikingPlay,
    SoftPlay,
    HousedWinding,
    LadderedHeat,
    LossyGear,
    WarmMagnets,
)
