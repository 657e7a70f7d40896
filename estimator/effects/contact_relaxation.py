"""Forces and sinkage that follow over a length of travel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.history import followed, run_begins
from gritd.estimator.stages.situation import Balanced, Complete, OnSoil, Reaction, Recall
from gritd.estimator.terramechanics.soil import Array, Scalar

ARC = 1.0  # [rad] of a usual contact
USUAL, SHALLOW = 0.5, 0.05  # sin θ₁ at which Λ = λ, and the least that counts
SLIP_KNOWN = 2e-3  # [m] of travel that tells a slip
DRIVEN = 0.9  # |direction| of travel, below which the wheel is at rest or turns round


@dataclass(frozen=True)
class ContactRelaxation(Effect):
    """Forces and sinkage follow a change of slip or load over a length of travel, because the wheel
    has to move on to new soil first.

    y = y∞ + a (ȳ − y∞),   Λ dȳ/ds = y∞ − ȳ,   Λ = λ (1 − g + 2 g sin θ₁);   q Λ for the sinkage
    ds = p r |dψ| + (1 − p) |dx|

    y∞ is T, DP or z at the slip and load of the moment, the run's first value where it begins. At
    rest z stays where it is; in the air nothing lags. On line the forces are those of a slip and a
    load that lag in the same way.
    Source: first-order relaxation of a rolling contact, Pacejka (2012), Tire and Vehicle Dynamics,
    3rd ed., chapter 7. Four things were chosen here. The path may be the rim's, which shears the
    soil, or the axle's, which brings new soil under it. The sinkage has a length of its own: the
    rim shears new soil after one contact, and a rut is dug over more. The soil under the rim is
    renewed over the contact length r sin θ₁: λ is that of θ₁ = 30°. Where the wheel stops or turns
    round, soil that is sheared elastically starts from nought, and soil that was heaped and packed
    keeps the size that the forces had: of a share m of the forces it is the size that follows.
    """

    forces: float = strength(
        "share of a change of T and DP that lags, a", "", typical=1.0, low=0.0, high=1.5
    )
    sinkage: float = strength(
        "share of a change of z that lags, a", "", typical=1.0, low=0.0, high=1.5
    )
    length: float = shape("relaxation length, λ", "m", mean=0.03, sigma=0.02, low=0.002, high=0.15)
    deeper: float = shape(
        "relaxation length of the sinkage over λ, q", "", mean=1.0, sigma=0.39, low=0.2, high=5.0
    )
    rim: float = shape(
        "share of the rim's way in the path, p", "", mean=0.5, sigma=0.19, low=0.0, high=1.0
    )
    longer: float = shape(
        "share of λ that goes with the contact, g", "", mean=0.5, sigma=0.19, low=0.0, high=1.0
    )
    kept: float = shape(
        "share of T and DP that keeps its size through rest and reversal, m",
        "",
        mean=0.5,
        sigma=0.19,
        low=0.0,
        high=1.0,
    )

    stage = "wheel"
    fingerprint = Fingerprint(
        "sinkage",
        "load",
        "sinkage, torque and drawbar pull trail a step of load or slip over the same length at any "
        "speed",
    )
    at_start = ()
    confusable_with = told_apart(
        sensor_latency="speed_step", load_axis_friction="slip_step", running_in="load_step"
    )

    @classmethod
    def in_steady_states(cls) -> None:
        return None

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        if np.ndim(situation.torque) == 0:
            return reaction
        length = self._length(situation)
        deeper, run = self._shares(situation, self.deeper * length), situation.run
        sunk = followed(situation.sinkage, deeper, run) - situation.sinkage
        torque, pull = self._behind(situation, length)
        return replace(
            reaction,
            torque=reaction.torque + torque,
            drawbar_pull=reaction.drawbar_pull + pull,
            sinkage=reaction.sinkage + self.sinkage * sunk,
        )

    def answered(self, slip: Scalar, load: Scalar, situation: Complete) -> tuple[Scalar, Scalar]:
        behind = situation.memory.get(self.name, ())
        if not behind:
            return slip, load
        lagging, rate = min(self.forces, 1.0), _mobilising(situation)
        mobilised = -np.expm1(-rate * slip)
        slip = -np.log1p(-(mobilised + lagging * (behind[0] - mobilised))) / rate
        return (
            slip,
            load + lagging * (behind[1] - load),
        )

    def remember(self, memory: Recall, step: float, situation: Complete) -> Recall:
        mobilised = -np.expm1(-_mobilising(situation) * situation.slip)
        now = float(mobilised), float(situation.carried)
        rim = situation.radius * np.abs(situation.wheel_speed)
        moved = self._path(rim, np.abs(situation.carriage_speed)) * step
        if not memory or situation.carried <= 0.0:
            return now
        share = float(-np.expm1(-moved / self._length(situation)))
        return tuple(m + share * (n - m) for m, n in zip(memory, now, strict=True))

    def _path(self, rim: Scalar, axle: Scalar) -> Scalar:
        """ds of the ways of rim and axle."""
        return self.rim * rim + (1.0 - self.rim) * axle

    def _length(self, situation: Balanced) -> Scalar:
        """Λ [m]."""
        shallow = np.maximum(np.sin(situation.theta_1), SHALLOW)
        return self.length * (1.0 - self.longer + self.longer * shallow / USUAL)

    def _behind(self, situation: Balanced, length: Scalar) -> Array:
        """a (ȳ − y∞) of T and DP (2, n); at rest the soil's forces fade out, and what they lag
        too. length: Λ [m].
        """
        steady = np.stack((situation.torque, situation.drawbar_pull))
        run, way = situation.run, np.broadcast_to(situation.direction, steady.shape[1:])
        size = _size(steady, way, run)
        begun = _begun(size, self._shares(situation, SLIP_KNOWN), run)
        share = self._shares(situation, length)
        signed, sized = followed(np.stack((steady, begun)), share, run) - (steady, size)
        kept, lost = self.kept * way, (1.0 - self.kept) * np.abs(way)
        return np.asarray(self.forces * (kept * sized + lost * signed))

    def _shares(self, situation: Balanced, length: Scalar) -> Array:
        """Of the way to y∞ that ȳ goes from one sample to the next over a length [m] (n,)."""
        rim = situation.radius * _steps(situation.wheel_angle)
        moved = self._path(rim, _steps(situation.position))
        return np.where(situation.carried > 0.0, -np.expm1(-moved / length), 1.0)


def _size(force: Array, way: Array, run: Scalar) -> Array:
    """Forces (k, n) in the direction of travel, through a rest those of the latest travel of the
    run, before that those of its first; nought in a run that does not travel.
    """
    number = np.arange(way.size)
    driven = np.abs(way) > DRIVEN
    first = np.maximum.accumulate(np.where(run_begins(run, way.size), number, 0))
    latest = np.maximum.accumulate(np.where(driven, number, -1))
    coming = np.minimum.accumulate(np.where(driven, number, way.size)[::-1])[::-1]
    at = np.where(latest >= first, latest, np.minimum(coming, way.size - 1))
    known = driven[at] & (first[at] == first)
    return np.asarray(np.where(known, force[:, at] / np.where(known, way[at], 1.0), 0.0))


def _begun(size: Array, share: Array, run: Scalar) -> Array:
    """The same (k, n), the first of a run a mean over the way that it begins with: at the moment a
    wheel starts its slip is not known.
    """
    begins = run_begins(run, share.size)
    back = np.broadcast_to(run, share.size)[::-1]
    before = followed(size[:, ::-1], np.append(1.0, share[:0:-1]), back)[:, ::-1]
    return np.where(begins, before, size)


def _mobilising(situation: OnSoil) -> Scalar:
    """j/k halfway along a usual contact at slip 1: T and DP go with slip as 1 − e^(−i j/k)."""
    return 0.5 * ARC * situation.radius / situation.shear_modulus


def _steps(path: Scalar) -> Scalar:
    """Length of each step along a path, 0 at the first."""
    return np.abs(np.diff(path, prepend=np.ravel(path)[:1]))
