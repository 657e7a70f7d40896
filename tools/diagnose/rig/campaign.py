"""All runs of a campaign through the forward model, in one call unless an effect needs each run by
itself.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.balance import Balance, part_of
from gritd.estimator.model.forward import Carried, carried, responded
from gritd.estimator.stages.situation import Motion, Sensed, situation_of
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel
from gritd.tools.diagnose.tuning import TUNING

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Driven:
    """What readings depend on; weights (N,) and travel are factors on the motions'."""

    soil: Soil
    weights: Array
    travelled: float
    effects: tuple[Effect, ...]

    @cached_property
    def key(self) -> Hashable:
        return self.soil, self.weights.tobytes(), self.travelled, self.effects

    def bearing(self) -> Driven:
        """With only the effects that bear on the soil."""
        return replace(self, effects=tuple(e for e in self.effects if e.bears_on_soil()))


class Campaign:
    """The motions of all runs one after the other (N,); `parts` says where each run lies.

    A balance starts at that of the soil and effects which the campaign is made with: what it is
    read as follows from what is asked alone.
    """

    def __init__(
        self,
        motions: Sequence[Motion],
        settings: Settings,
        channels: Sequence[str],
        soil: Soil,
        effects: Sequence[Effect] = (),
    ) -> None:
        self._settings, self._channels = settings, tuple(channels)
        self._motions = [_filled(motion, settings.wheel) for motion in motions]

        self.parts = parts_of(self._motions)
        self._joined = _joined(self._motions)
        self._carried: dict[Hashable, Carried] = {}
        self._readings: dict[Hashable, Array] = {}
        self._begins: Balance | None = None
        if all(_at_once(effect) for effect in effects):
            self._begins = self._balanced(soil, self._joined, effects, None).balance

    def readings(self, driven: Driven, near: Driven | None = None) -> Array:
        """True readings (channels, N); near: what has a balance from which this one is looked for,
        if not from that of the beginning.
        """
        near = None if near is None or near.key == driven.key else near
        key = driven.key, near and near.key
        return _recent(self._readings, key, lambda: self._read_anew(driven, near))

    def _read_anew(self, driven: Driven, near: Driven | None) -> Array:
        effects = driven.effects
        if all(_at_once(effect) for effect in effects):
            return self._read(self._solved(driven.bearing(), near and near.bearing()), effects)

        read = []
        for motion, part in zip(self._motions, self.parts, strict=True):
            scaled = _scaled(motion, driven.weights[part], driven.travelled)
            begins = self._begins and part_of(self._begins, part)
            solved = self._balanced(driven.soil, scaled, effects, begins)
            read.append(self._read(solved, effects))
        return np.hstack(read)

    def _solved(self, driven: Driven, near: Driven | None) -> Carried:
        """What the soil carries in all runs; solved anew only where something bears on it."""
        near = None if near is None or near.key == driven.key else near
        motion = _scaled(self._joined, driven.weights, driven.travelled)

        def solved() -> Carried:
            begins = self._begins if near is None else self._solved(near, None).balance
            return self._balanced(driven.soil, motion, driven.effects, begins)

        return _recent(self._carried, (driven.key, near and near.key), solved)

    def _balanced(
        self, soil: Soil, motion: Motion, effects: Sequence[Effect], near: Balance | None
    ) -> Carried:
        order = TUNING.rig.quadrature_order
        return carried(self._settings.wheel, soil, motion, effects, near=near, order=order)

    def _read(self, solved: Carried, effects: Sequence[Effect]) -> Array:
        """(channels, n)."""
        constant = self._settings.drive.torque_constant.value
        sensed = responded(solved, effects, torque_constant=constant).sensed
        return np.stack([sensed_as(sensed, c, self._settings) for c in self._channels])


def _recent(kept: dict[Hashable, T], key: Hashable, make: Callable[[], T]) -> T:
    """The value of a key, made where it is not among the last few."""
    if key not in kept and len(kept) >= TUNING.numerics.kept:
        kept.pop(next(iter(kept)))
    kept[key] = value = kept.pop(key) if key in kept else make()
    return value


def parts_of(motions: Sequence[Motion]) -> list[slice]:
    """Where each run lies in the vector (N,) of all."""
    ends = np.cumsum([0, *(np.size(m.time) for m in motions)])
    return [slice(*pair) for pair in pairwise(ends.tolist())]


def sensed_as(sensed: Sensed, channel: str, settings: Settings) -> Array:
    """A channel's readings (n,) in its unit; `torque` is the motor's, by its current."""
    if channel == "torque":
        return np.asarray(settings.drive.torque_constant.value * sensed.current)
    return np.asarray(getattr(sensed, "torque" if channel == "axle_torque" else channel))


def _at_once(effect: Effect) -> bool:
    """Whether runs may follow one another in one array without touching."""
    listed = EFFECTS.get(effect.name)
    return listed is not None and isinstance(effect, listed) and not effect.by_run


def _filled(motion: Motion, wheel: Wheel) -> Motion:
    """All fields arrays (n,), and the acceleration known: only a run itself can tell it."""
    ones = np.ones(np.size(motion.time))
    return replace(
        motion,
        load=motion.load * ones,
        pass_number=motion.pass_number * ones,
        start_position=motion.start_position * ones,
        wheel_acceleration=situation_of(motion, wheel).wheel_acceleration,
    )


def _joined(motions: Sequence[Motion]) -> Motion:
    names = (
        "time", "wheel_angle", "wheel_speed", "carriage_position", "carriage_speed", "load",
        "pass_number", "start_position", "wheel_acceleration",
    )  # fmt: skip
    joined = {name: np.concatenate([getattr(m, name) for m in motions]) for name in names}
    number = np.repeat(np.arange(len(motions), dtype=float), [np.size(m.time) for m in motions])
    return Motion(**joined, run=number)


def _scaled(motion: Motion, weights: Array, travelled: float) -> Motion:
    return replace(
        motion,
        load=motion.load * weights,
        carriage_speed=motion.carriage_speed * travelled,
        carriage_position=motion.carriage_position * travelled,
    )
