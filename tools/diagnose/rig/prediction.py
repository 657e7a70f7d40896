"""Every channel of a wheel in soil as the forward model predicts it, for constants and effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.rig.campaign import Campaign, parts_of, sensed_as
from gritd.tools.diagnose.rig.constants import LEAN
from gritd.tools.diagnose.rig.interface import Bools, Channels, Constant, Foreseen, Index
from gritd.tools.diagnose.rig.proposals import driving, proposed
from gritd.tools.diagnose.rig.weight_sets import WeightSets
from gritd.tools.diagnose.tuning import TUNING

SOIL = ("c", "tan_phi", "k", "n", "K")


@dataclass(frozen=True)
class Driven:
    """What was driven, run by run.

    motions: on the analysis grid.
    steps:   grid intervals [s].
    new:     whether candidates act; not in the runs of a reference campaign.
    sets:    the set of weights that each value has.
    """

    motions: Sequence[Motion]
    steps: Sequence[float]
    new: Sequence[bool]
    sets: WeightSets

    def motions_of(self, new: bool) -> list[Motion]:
        """Those of the new campaign, or of the reference."""
        return [motion for motion, n in zip(self.motions, self.new, strict=True) if n == new]

    def set_of(self, new: bool) -> Index:
        """The set of weights of each value (n,) of the new campaign, or of the reference."""
        labels = [label for label, n in zip(self.sets.label, self.new, strict=True) if n == new]
        return np.concatenate(labels)


class Prediction:
    """Channels of all runs, for the constants of a wheel.

    prepared: soil constants that a bed prepared anew has for itself; there is a constant `new_NAME`
    of each. idle: where channel torque is compared as motor torque less axle torque, the values of
    each run (n,) at which it is compared alone; else None. means: of each run, what is added to
    every channel (n,); else None.
    """

    def __init__(
        self,
        settings: Settings,
        channels: Sequence[str],
        constants: Sequence[Constant],
        driven: Driven,
        prepared: Sequence[str],
        idle: Sequence[Bools] | None,
        means: Sequence[Channels] | None,
    ) -> None:
        self._settings, self._channels, self._constants = settings, channels, constants
        self._means = None if means is None else [np.array([m[c] for c in channels]) for m in means]
        self._driven, self._prepared = driven, prepared
        self._less_axle = None if idle is None else ~np.concatenate(idle)

        prior = {constant.name: constant.value for constant in constants}
        begins = self._soil(prior, False), self._baseline(prior)
        self._campaigns = [
            (new, Campaign(driven.motions_of(new), settings, channels, *begins))
            for new in sorted(set(driven.new))  # the reference first, where there is one
        ]

        self._parts = parts_of(driven.motions)
        sizes = [part.stop - part.start for part in self._parts]
        self._load = np.concatenate([m.load * np.ones(np.size(m.time)) for m in driven.motions])
        self._step: Array = np.repeat(driven.steps, sizes)
        self._inner = np.ones(sum(sizes), bool)  # with a neighbour of the same run on either side
        for part in self._parts:
            self._inner[[part.start, part.stop - 1]] = False

    def channels(
        self, u: Array, effects: Sequence[Effect], everywhere: bool = False
    ) -> list[dict[str, Array]]:
        """See interface.Predict."""
        value = self._values(u)
        baseline = self._baseline(value)

        true = []  # readings (channels, n) of each campaign before scale, offset and delay
        for new, campaign in self._campaigns:
            acting = (*baseline, *effects) if new or everywhere else baseline
            weights = 1.0 + value["weights"] + self._own_weights(value)[self._driven.set_of(new)]
            travelled = 1.0 + value["carriage_scale"]
            true.append(campaign.readings(self._soil(value, new), weights, travelled, acting))

        read = self._read(np.hstack(true), value)
        if self._means is not None:
            read += np.hstack(self._means)
        return [dict(zip(self._channels, read[:, part], strict=True)) for part in self._parts]

    def foresee(self, experiment: str, u: Array, effects: Sequence[Effect]) -> Foreseen:
        """See interface.Rig: constants u (q,), effects as fitted."""
        value = self._values(u)
        sensed = simulate_arrays(
            self._settings.wheel,
            self._soil(value, True),
            proposed(experiment, self._driven.motions, self._settings.wheel.radius),
            (*self._baseline(value), *effects),
            torque_constant=self._settings.drive.torque_constant.value,
            order=TUNING.rig.quadrature_order,
        ).sensed

        read = np.array(
            [sensed_as(sensed, c, self._settings) + value[f"{c}_offset"] for c in self._channels]
        )
        if self._less_axle is not None:
            read = self._less(read, np.ones(read.shape[1], bool))
        compared = dict(zip(self._channels, read, strict=True))
        return Foreseen(
            compared, {c: driving(experiment) | (c == "torque") for c in self._channels}
        )

    def _values(self, u: Array) -> dict[str, float]:
        return {c.name: c.of(float(x)) for c, x in zip(self._constants, u, strict=True)}

    def _baseline(self, value: Mapping[str, float]) -> tuple[Effect, ...]:
        return tuple(
            make(e.name, {p: value.get(f"{e.name}.{p}", q.value) for p, q in e.parameters.items()})
            for e in self._settings.effects
        )

    def _own_weights(self, value: Mapping[str, float]) -> Array:
        """Relative error of each set of weights for itself (m + 1,), the last of values without
        one.
        """
        return np.array([*(value[name] for name in self._driven.sets.names), 0.0])

    def _soil(self, value: Mapping[str, float], new: bool) -> Soil:
        """The soil of one campaign: a bed that was prepared anew has its own."""
        shift = {name: np.exp(value[f"new_{name}"]) if new else 1.0 for name in self._prepared}
        return Soil(*(value[name] * float(shift.get(name, 1.0)) for name in SOIL))

    def _read(self, true: Array, value: Mapping[str, float]) -> Array:
        """What the sensors make of true readings (channels, N)."""
        scale, offset, delay, blur = (
            np.array([value[f"{c}_{what}"] for c in self._channels])[:, None]
            for what in ("scale", "offset", "delay", "blur")
        )
        read = true * (1.0 + scale) + offset
        if "side_force" in self._channels:
            read[self._channels.index("side_force")] += value[LEAN] * self._load

        before, after = np.roll(read, 1, axis=1), np.roll(read, -1, axis=1)
        rate, bend = (after - before) / (2.0 * self._step), after + before - 2.0 * read
        read = np.where(self._inner, read - delay * rate + blur * bend, read)
        return read if self._less_axle is None else self._less(read, self._less_axle)

    def _less(self, read: Array, where: Bools) -> Array:
        """Of what the channels read (channels, N): at marked values (N,) what the drive loses
        between its two torques.
        """
        motor, axle = (self._channels.index(name) for name in ("torque", "axle_torque"))
        out = np.array(read)
        out[motor] -= np.where(where, read[axle], 0.0)
        return out
