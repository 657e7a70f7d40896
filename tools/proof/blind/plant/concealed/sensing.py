"""Effects of the sensors, beyond noise and calibration: belts, leaks, lags."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.memory import lagged, mean_before
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.plant.servo import summed

FORCE = ("pull", "load", "torque")  # channels of the force sensor


@dataclass(frozen=True)
class TurnedSensor(PlantEffect):
    """The sensor is mounted turned by a small angle, and torque bends it: DP cos ε + W sin ε + a T.

    Source: a sensor's frame turned about the axle, and one off-diagonal term of its matrix.
    """

    torque_share: float = 0.0  # how much of the leak is the torque's
    lever: float = 0.1  # [m] that makes torque and load alike in size

    name, signed, most = "force_crosstalk", True, 0.1

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(
            cls.most * cls.sign(rng),
            float(rng.choice((0.0, 0.5, 1.0))),
            facts.torque / facts.weight,
        )

    def sensed(self, felt: Felt) -> Felt:
        load = (1.0 - self.torque_share) * np.sin(self.strength) * felt.load
        torque = self.torque_share * self.strength * felt.torque / self.lever
        return felt.read(pull=felt.pull * np.cos(self.strength) + load + torque)


@dataclass(frozen=True)
class BendingSensor(PlantEffect):
    """DP + a W (1 + W/W₀)/2: the sensor bends under the load, and leaks more the more it is bent.

    Source: second-order term of a bending beam's matrix.
    """

    weight: float = 60.0  # W₀ [N]

    name, signed, most = "force_crosstalk", True, 0.1

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.weight)

    def sensed(self, felt: Felt) -> Felt:
        leak = 0.5 * self.strength * felt.load * (1.0 + felt.load / self.weight)
        return felt.read(pull=felt.pull + leak)


@dataclass(frozen=True)
class CreepingBelt(PlantEffect):
    """The belt creeps on the pulley by s + s' |F|, F what it transmits: the encoder sees less than
    the travel.

    Source: elastic creep goes with the tension difference, Johnson (1985), Contact Mechanics,
        section 8.2.
    """

    loading: float = 0.0  # how much of the creep goes with the force
    typical: float = 20.0  # [N]

    name, most = "pulley_slip", 0.12

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.0, 0.3)), 0.3 * facts.weight)

    def sensed(self, felt: Felt) -> Felt:
        force = np.abs(felt.pull) / self.typical
        return _unseen(felt, self.strength * (1.0 - self.loading + self.loading * force))


@dataclass(frozen=True)
class WornPulley(PlantEffect):
    """The belt creeps by s (1 + w cos(x/r_p)): one side of the pulley grips less.

    Source: kinematics of a pulley of radius r_p with a worn spot.
    """

    worn: float = 0.5  # w
    pulley: float = 0.02  # r_p [m]

    name, most = "pulley_slip", 0.12

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.3, 0.8)))

    def sensed(self, felt: Felt) -> Felt:
        wave = 1.0 + self.worn * np.cos(felt.carriage / self.pulley)
        return _unseen(felt, self.strength * wave)


def _unseen(felt: Felt, creep: Array) -> Felt:
    """The carriage as its encoder sees it where the belt creeps by this share of what is seen."""
    step = felt.scene.motion.step
    missed = np.gradient(felt.carriage, step) * creep / (1.0 + creep)
    return felt.read(carriage=felt.carriage - summed(missed, step))


@dataclass(frozen=True)
class LateChannel(PlantEffect, ABC):
    """One channel is late; its forms say how."""

    channel: str = "sinkage"

    name, most = "sensor_latency", 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, str(rng.choice(("sinkage", "current", "force"))))

    @abstractmethod
    def late(self, values: Array, time: Array) -> Array:
        """The readings (n,) as they come late, at times (n,) [s]."""

    def sensed(self, felt: Felt) -> Felt:
        if not self.strength:
            return felt
        names, time = FORCE if self.channel == "force" else (self.channel,), felt.scene.motion.time
        return felt.read(**{name: self.late(getattr(felt, name), time) for name in names})


@dataclass(frozen=True)
class FilteredLatency(LateChannel):
    """Half by transport and half by a low-pass filter."""

    def late(self, values: Array, time: Array) -> Array:
        """Readings (n,), in their own unit, moved by τ/2 and low-passed with τ/2; times (n,) [s]
        are of a fixed step.
        """
        moved = np.interp(time - 0.5 * self.strength, time, values)
        return lagged(moved, np.full(time.size, time[1] - time[0]), 0.5 * self.strength)


@dataclass(frozen=True)
class AveragedLatency(LateChannel):
    """The mean of the last 2 τ. Source: an integrating converter."""

    def late(self, values: Array, time: Array) -> Array:
        """Means of readings (n,) over the last 2 τ, in their own unit, at times (n,) [s]."""
        return mean_before(values, time, 2.0 * self.strength)


EFFECTS: tuple[type[PlantEffect], ...] = (
    TurnedSensor,
    BendingSensor,
    CreepingBelt,
    WornPulley,
    FilteredLatency,
    AveragedLatency,
)
