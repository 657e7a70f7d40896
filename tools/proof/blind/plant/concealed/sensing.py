"""Effects of the sensors, beyond their noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.plant.servo import summed


@dataclass(frozen=True)
class CurrentOffset(Effect):
    """The amplifier reads I₀ more than there is."""

    name, signed, most = "current_offset", True, 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.3 * facts.current * cls.sign(rng))

    def sensed(self, felt: Felt) -> Felt:
        return felt.read(current=felt.current + self.strength)

    def coinciding(self) -> dict[str, float]:
        return {"offset": self.strength}


@dataclass(frozen=True)
class ForceCrosstalk(Effect):
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
class PulleySlip(Effect):
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
        force = np.abs(felt.scene.pull) / self.typical
        creep = self.strength * (1.0 - self.loading + self.loading * force)
        step = felt.scene.motion.step
        missed = np.gradient(felt.carriage, step) * creep / (1.0 + creep)
        return felt.read(carriage=felt.carriage - summed(missed, step))


@dataclass(frozen=True)
class SensorLatency(Effect):
    """One channel is late, half by transport and half by a low-pass filter."""

    channel: str = "sinkage"

    name, most = "sensor_latency", 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, str(rng.choice(("sinkage", "current", "force"))))

    def sensed(self, felt: Felt) -> Felt:
        names = ("pull", "load", "torque") if self.channel == "force" else (self.channel,)
        return felt.read(
            **{name: self._late(getattr(felt, name), felt.scene.motion.time) for name in names}
        )

    def _late(self, values: Array, time: Array) -> Array:
        moved = np.interp(time - 0.5 * self.strength, time, values)
        gain = 1.0 - np.exp(-(time[1] - time[0]) / max(0.5 * self.strength, 1e-9))
        state, late = float(moved[0]), []
        for value in moved.tolist():
            state += gain * (value - state)
            late.append(state)
        return np.array(late)


@dataclass(frozen=True)
class SinkageDatum(Effect):
    """The potentiometer's zero is z₀ off the surface."""

    name, signed, most = "sinkage_datum", True, 0.005

    def sensed(self, felt: Felt) -> Felt:
        return felt.read(sinkage=felt.sinkage + self.strength)

    def coinciding(self) -> dict[str, float]:
        return {"offset": self.strength}


@dataclass(frozen=True)
class SinkageGain(Effect):
    """The potentiometer's scale is off by a factor."""

    name, signed, most = "sinkage_gain", True, 0.25

    def sensed(self, felt: Felt) -> Felt:
        return felt.read(sinkage=felt.sinkage * (1.0 + self.strength))

    def coinciding(self) -> dict[str, float]:
        return {"gain": self.strength}


EFFECTS: tuple[type[Effect], ...] = (
    CurrentOffset,
    ForceCrosstalk,
    PulleySlip,
    SensorLatency,
    SinkageDatum,
    SinkageGain,
)
