"""Wheels that roll side by side, each in a lane of its own, on one grid of steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim, Sampled
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene


class Moment(NamedTuple):
    """One step, arrays (lanes, 1)."""

    rolled: Array  # way of the rim since the step before [m]
    moved: Array  # way of the carriage since the step before [m]
    place: Array  # of the carriage [m]
    weight: Array  # [N]
    ground: PlantSoil
    rim: Rim


class Lanes(NamedTuple):
    """All steps of all lanes, arrays (steps, lanes, 1). A run that has ended stands still."""

    rolled: Array
    moved: Array
    place: Array
    weight: Array
    ground: PlantSoil
    rim: Rim
    radius: Array  # (lanes, 1) mean radius of the wheel [m]
    passes: NDArray[np.int64]  # (lanes,) 1 on fresh soil

    def moments(self) -> list[Moment]:
        """One step after the other."""
        motion = zip(self.rolled, self.moved, self.place, self.weight, strict=True)
        return [
            Moment(*parts, _at(self.ground, step), _at(self.rim, step))
            for step, parts in enumerate(motion)
        ]


def _at(what: Sampled, step: int) -> Sampled:
    taken: dict[str, Any] = {f.name: getattr(what, f.name)[step] for f in fields(what)}
    return replace(what, **taken)


def lanes(scenes: Sequence[Scene], weights: Sequence[Array], step: float) -> Lanes:
    """Scenes as lanes on a grid of `step` [s], under weights (n,) [N] of their own."""
    grids = [grid(scene, step) for scene in scenes]

    def stacked(given: Sequence[Array | float]) -> Array:
        return _stacked(scenes, grids, given)

    place = stacked([scene.motion.travel for scene in scenes])
    rolled = stacked([np.cumsum(scene.rim_speed) * scene.motion.step for scene in scenes])
    ground = {
        f.name: stacked([getattr(s.ground, f.name) for s in scenes]) for f in fields(PlantSoil)
    }
    rim = {f.name: stacked([getattr(s.rim, f.name) for s in scenes]) for f in fields(Rim)}
    return Lanes(
        np.diff(rolled, axis=0, prepend=rolled[:1]),
        np.diff(place, axis=0, prepend=place[:1]),
        place,
        stacked(weights),
        PlantSoil(**ground),
        Rim(**rim),
        np.array([[float(scene.radius.mean())] for scene in scenes]),
        np.array([scene.motion.passes for scene in scenes]),
    )


def grid(scene: Scene, step: float) -> Array:
    """The steps (k,) of one scene [s]."""
    time = scene.motion.time
    return np.asarray(np.arange(time[0], time[-1] + step, step))


def _stacked(
    scenes: Sequence[Scene], grids: Sequence[Array], given: Sequence[Array | float]
) -> Array:
    """Values of each scene (n,) on its grid, the last one held: (steps, lanes, 1)."""
    longest = max(steps.size for steps in grids)
    columns = []
    for scene, steps, values in zip(scenes, grids, given, strict=True):
        time = scene.motion.time
        sampled = np.interp(steps, time, np.broadcast_to(values, time.size))
        columns.append(np.pad(sampled, (0, longest - steps.size), mode="edge"))
    return np.stack(columns, axis=1)[:, :, None]
