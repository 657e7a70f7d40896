"""A bed of strips that remembers: with no stress of Eqs. (3)-(7).

The bed is cut across into strips. Each bears pressure by Bekker, is pressed down for good where it
yields, and unloads on a stiff spring; each gathers its own shear displacement while the rim is on
it (Janosi). So stress peaks at the bottom, the rut stays, and the forces follow a change of slip
over the length of the contact. After Krenn and Hirzinger (2009), 11th European ISTVS Conf., and
Tasora, Mangoni, Negrut, Serban, Jayakumar (2019), Int. J. Vehicle Performance 5(2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.tools.proof.blind.plant.bed import LIFTED
from gritd.tools.proof.blind.plant.contact import Sliding, sheared
from gritd.tools.proof.blind.plant.lanes import Lanes, Moment, grid, lanes
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import HANGING, Scene

REACH = 0.95  # of the radius, how far ahead and behind the rim can touch
SHALLOW = 0.1  # of the radius, a usual sinkage: what the stiffness of unloading is measured by
NEWTON, FIRST = 20, 80  # steps of the vertical balance, at most; the same to set the wheel down
CLOSE = 1e-6  # relative error of the load at which the search ends
LEAP = 0.02  # of the radius, the longest step of the search


@dataclass(frozen=True)
class StripBed:
    """`recovery`: share of a usual sinkage that springs back behind the wheel."""

    recovery: float = 0.05
    strips: int = 24  # to a radius
    step: float = 0.05  # [s]

    def carry(self, scenes: Sequence[Scene], weights: Sequence[Array], damped: bool) -> list[Scene]:
        """See `Bed.carry`; weights (n,) of each scene. The axle is in balance, `damped` or not; the
        strips hold it back.
        """
        felt = _Strips(self, scenes, lanes(scenes, weights, self.step)).felt()
        return [
            _answered(scene, weight, felt, lane, grid(scene, self.step))
            for lane, (scene, weight) in enumerate(zip(scenes, weights, strict=True))
        ]


class StripReaction(NamedTuple):
    """What the bed does at one step (lanes, 1), or at all of them (steps, lanes)."""

    sinkage: Array  # [m]
    torque: Array  # [N·m]
    pull: Array  # [N]
    side: Array  # [N]
    pressure: Array  # mean over the contact [Pa]


def _answered(scene: Scene, weight: Array, felt: StripReaction, lane: int, steps: Array) -> Scene:
    """The scene with what its lane felt, at its own samples."""
    sinkage, torque, pull, side, pressure = (
        np.interp(scene.motion.time, steps, values[: steps.size, lane]) for values in felt
    )

    down, radius = weight > LIFTED, float(scene.radius.mean())
    return replace(
        scene,
        theta_1=np.where(down, np.arccos(np.clip(1.0 - sinkage / radius, 0.0, 1.0)), 1e-6),
        sinkage=np.where(down, sinkage, HANGING),
        carried=np.where(down, weight, 0.0),
        torque=torque * down,
        pull=pull * down,
        side=side * down,
        pressure=pressure * down,
    )


class Under(NamedTuple):
    """The strips under each wheel at one step, arrays (lanes, strips)."""

    flat: NDArray[np.int64]  # among the strips of all lanes
    above: Array  # height of the rim over its lowest point [m]
    sine: Array  # of θ, positive forward
    cosine: Array
    area: Array  # of the rim over a strip [m²]
    depth: Array  # how deep a strip stays pressed [m]
    along: Array  # shear displacement [m]
    sliding: Sliding | None  # since the step before, of a skewed wheel [m]
    stiff: Array  # of unloading [Pa/m], (lanes, 1)


class _Strips:
    """The strips of all lanes, one lane after the other, and what they have been through."""

    def __init__(self, bed: StripBed, scenes: Sequence[Scene], rolling: Lanes) -> None:
        self._rolling, self._radius = rolling, rolling.radius
        self._pitch, self._width = scenes[0].rig.radius / bed.strips, scenes[0].rig.width
        self._recovery = bed.recovery

        # each lane has its own origin, so that what rolls beside it changes nothing
        margin = 2.0 * scenes[0].rig.radius
        near = int(REACH * float(self._radius.max()) / self._pitch) + 1
        self._window = np.arange(-near, near + 1)
        self._origin = rolling.place.min(axis=0) - margin
        self._count = int((np.ptp(rolling.place, axis=0).max() + 2.0 * margin) / self._pitch) + 1
        self._lane = self._count * np.arange(len(scenes))[:, None]

        self._depth = np.zeros(self._count * len(scenes))
        self._along = np.zeros_like(self._depth)
        self._sinkage = np.zeros((len(scenes), 1))

    def felt(self) -> StripReaction:
        """All steps, (steps, lanes). Where soil is driven again, the passes before were alike."""
        moments, passes = self._rolling.moments(), self._rolling.passes
        forces: list[StripReaction] = []
        for left in range(int(passes.max()) - 1, -1, -1):
            self._depth *= np.repeat(passes > left + 1, self._count)
            self._along[:], self._sinkage[:] = 0.0, 0.0
            forces = [
                self._step(moment, FIRST if not n else NEWTON) for n, moment in enumerate(moments)
            ]
        return StripReaction(*(np.stack(parts)[:, :, 0] for parts in zip(*forces, strict=True)))

    def _step(self, now: Moment, most: int) -> StripReaction:
        under = self._under(now)
        self._balance(now, under, most)

        pressure, yielding = self._pressure(now, under)
        touched = pressure > 0.0
        tau, across = sheared(now.ground, now.rim, pressure, under.along, under.sliding)
        force, side = tau * under.area * touched, across * under.area * touched
        pressed = pressure * under.area

        dent = self._sinkage - under.above - pressure / under.stiff
        self._depth[under.flat] = np.where(yielding, dent, under.depth)
        self._along[under.flat] = under.along * touched
        total = (under.area * touched).sum(axis=1, keepdims=True)
        return StripReaction(
            self._sinkage.copy(),
            self._radius * force.sum(axis=1, keepdims=True),
            (force * under.cosine - pressed * under.sine).sum(axis=1, keepdims=True),
            side.sum(axis=1, keepdims=True),
            pressed.sum(axis=1, keepdims=True) / np.maximum(total, 1e-12),
        )

    def _under(self, now: Moment) -> Under:
        middle = ((now.place - self._origin) / self._pitch).astype(np.int64)
        index = middle + self._window
        ahead = self._origin + (index + 0.5) * self._pitch - now.place
        sine = np.clip(ahead / self._radius, -REACH, REACH)
        cosine = np.sqrt(1.0 - sine**2)
        near = np.abs(ahead) < REACH * self._radius

        flat = index + self._lane
        moved = now.moved * now.rim.along
        slid = now.rolled - moved * cosine
        skewed = Sliding(slid, moved * now.rim.skew + np.zeros_like(slid))
        return Under(
            flat=flat,
            above=np.where(near, self._radius * (1.0 - cosine), 1.0),
            sine=sine,
            cosine=cosine,
            area=self._pitch * self._width / cosine,
            depth=self._depth[flat],
            along=self._along[flat] + slid,
            sliding=skewed if np.any(now.rim.skew) else None,
            stiff=self._stiffness(now),
        )

    def _stiffness(self, now: Moment) -> Array:
        """Of unloading [Pa/m]: a usual sinkage springs back by its share."""
        usual = now.ground.modulus * (SHALLOW * self._radius) ** (now.ground.exponent - 1.0)
        return np.asarray(usual / (self._recovery + now.rim.rebound))

    def _pressure(self, now: Moment, under: Under) -> tuple[Array, NDArray[np.bool_]]:
        """Normal stress [Pa], and where the strip yields: Bekker's K zⁿ, or the spring's."""
        deep = self._sinkage - under.above
        bearing = now.ground.modulus * np.maximum(deep, 0.0) ** now.ground.exponent
        spring = under.stiff * (deep - under.depth)
        return np.clip(spring, 0.0, bearing), spring > bearing

    def _balance(self, now: Moment, under: Under, most: int) -> None:
        """Sinkage at which the strips carry the weight: Newton's steps, halves where they leave
        what is known to be too high and too deep.
        """
        leap, weight = LEAP * self._radius, np.maximum(now.weight, LIFTED)
        high, deep = np.full_like(self._sinkage, -np.inf), np.full_like(self._sinkage, np.inf)

        for _ in range(most):
            upward, rise = self._load(now, under)
            miss = weight - upward
            if np.abs(miss).max() < CLOSE * weight.min():
                break
            high = np.where(miss > 0.0, np.maximum(high, self._sinkage), high)
            deep = np.where(miss < 0.0, np.minimum(deep, self._sinkage), deep)

            aimed = self._sinkage + np.clip(miss / np.maximum(rise, 1.0), -leap, leap)
            inside = (aimed > high) & (aimed < deep)
            known = np.isfinite(high) & np.isfinite(deep)
            with np.errstate(invalid="ignore"):  # of bounds that are not known yet
                half = np.where(known, 0.5 * (high + deep), aimed)
            self._sinkage = np.where(inside, aimed, half)

    def _load(self, now: Moment, under: Under) -> tuple[Array, Array]:
        """What the strips carry [N], and how it rises with the sinkage [N/m], but for shear."""
        pressure, yielding = self._pressure(now, under)
        touched = pressure > 0.0
        tau, _ = sheared(now.ground, now.rim, pressure, under.along, under.sliding)
        upward = (pressure * under.cosine + tau * under.sine * touched) * under.area
        dent = np.maximum(self._sinkage - under.above, 1e-9)
        slope = np.where(yielding, now.ground.exponent * pressure / dent, under.stiff * touched)
        rise = slope * under.cosine * under.area
        return upward.sum(axis=1, keepdims=True), rise.sum(axis=1, keepdims=True)
