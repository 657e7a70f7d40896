"""Physics that is in no list, for tests: effects made of formulas the library does not hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength
from gritd.estimator.stages.situation import Reaction, Sensed, Situation


def _size(typical: float) -> float:
    return strength("size", "", typical=typical, low=-1e6, high=1e6)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class BentRail(Effect):
    """The potentiometer's reference waves along the rail."""

    size: float = _size(1e-3)
    stage = "sensor"
    fingerprint = Fingerprint("sinkage", "position", "")

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(
            sensed, sinkage=sensed.sinkage + self.size * np.sin(situation.position / 0.05)
        )


@dataclass(frozen=True)
class CableChainDrag(Effect):
    """A cable pulls back more the farther the carriage is."""

    size: float = _size(3.0)
    stage = "testbed"
    fingerprint = Fingerprint("drawbar_pull", "position", "")

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        along = situation.position / 0.3
        return replace(
            reaction, drawbar_pull=reaction.drawbar_pull - self.size * along * np.abs(along)
        )


@dataclass(frozen=True)
class NextDoor(Effect):
    """A machine next door shakes the bed, and the force sensor feels it."""

    size: float = _size(0.5)
    stage = "testbed"
    fingerprint = Fingerprint("drawbar_pull", "time", "")

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        shaken = self.size * np.sin(2.0 * np.pi * situation.time / 1.7)
        return replace(reaction, drawbar_pull=reaction.drawbar_pull + shaken)


@dataclass(frozen=True)
class ShearBands(Effect):
    """Soil fails in bands: the pull swells and falls each time the rim has slid by 15 mm."""

    size: float = _size(0.5)
    stage = "testbed"
    fingerprint = Fingerprint("drawbar_pull", "slip", "")

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        speed = np.abs(situation.radius * situation.wheel_speed - situation.carriage_speed)
        slid = np.cumsum(speed * np.gradient(situation.time))
        bands = self.size * np.sin(2.0 * np.pi * slid / 0.015)
        return replace(reaction, drawbar_pull=reaction.drawbar_pull + bands)


@dataclass(frozen=True)
class RailJointDrag(Effect):
    """Beyond a joint of the rails the carriage drags."""

    size: float = _size(1.5)
    stage = "testbed"
    fingerprint = Fingerprint("drawbar_pull", "position", "")

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        beyond = 0.5 + 0.5 * np.tanh((situation.position - 0.2) / 0.003)
        return replace(reaction, drawbar_pull=reaction.drawbar_pull - self.size * beyond)
