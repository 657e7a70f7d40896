"""Every channel of a wheel in soil as the forward model predicts it, for constants and effects."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.rig.campaign import Campaign, Driven, parts_of, sensed_as
from gritd.tools.diagnose.rig.constants import LEAN, SOIL
from gritd.tools.diagnose.rig.interface import Bools, Constant, Foreseen, Held, Near
from gritd.tools.diagnose.rig.proposals import proposed
from gritd.tools.diagnose.rig.recorded import Recorded
from gritd.tools.diagnose.tuning import TUNING


class Prediction:
    """Channels of all runs, for the constants of a wheel.

    prepared: soil constants that a bed prepared anew has for itself; there is a constant `new_NAME`
    of each. held: of each run, what is added to every channel (n,).
    """

    def __init__(
        self,
        settings: Settings,
        data: Recorded,
        constants: Sequence[Constant],
        prepared: Sequence[str],
        held: Held | None,
    ) -> None:
        self._settings, self._constants, self._prepared = settings, constants, prepared
        self._data, self._channels = data, data.channels
        self._less_axle = None if data.idle is None else ~np.concatenate(data.idle)
        self._mean: Array | float = 0.0
        self._near: tuple[Array, Sequence[Effect], Collection[str]] | None = None
        self._driven_near: Sequence[Driven] = ()
        if held is not None:
            self._mean = np.hstack([np.array([m[c] for c in data.channels]) for m in held.means])

        prior = {constant.name: constant.value for constant in constants}
        begins = self._soil(prior, False), self._baseline(prior)
        self._campaigns = [
            (new, Campaign(data.motions_of(new), settings, data.channels, *begins))
            for new in sorted(set(data.new))  # the reference first, where there is one
        ]

        self._parts = parts_of(data.motions)
        sizes = [part.stop - part.start for part in self._parts]
        steps = [float(np.median(np.diff(s.time))) for s in data.signals]
        self._load = np.concatenate([m.load * np.ones(np.size(m.time)) for m in data.motions])
        self._step: Array = np.repeat(steps, sizes)
        self._inner = np.ones(sum(sizes), bool)  # with a neighbour of the same run on either side
        for part in self._parts:
            self._inner[[part.start, part.stop - 1]] = False

    def channels(
        self,
        u: Array,
        effects: Sequence[Effect],
        in_both: Collection[str] = (),
        near: Near | None = None,
    ) -> list[dict[str, Array]]:
        """See interface.Predict."""
        value = self._values(u)
        driven = self._driven(value, effects, in_both)
        begins = [None] * len(driven) if near is None else self._begins(near, in_both)

        # readings (channels, n) of each campaign before scale, offset and delay
        parts = zip(self._campaigns, driven, begins, strict=True)
        true = [campaign.readings(own, begin) for (_, campaign), own, begin in parts]
        read = self._read(np.hstack(true), value) + self._mean
        return [dict(zip(self._channels, read[:, part], strict=True)) for part in self._parts]

    def foresee(self, experiment: str, u: Array, effects: Sequence[Effect]) -> Foreseen:
        """See interface.Rig: constants u (q,), effects as fitted."""
        value = self._values(u)
        motion = proposed(experiment, self._data.motions, self._settings.wheel.radius)
        sensed = simulate_arrays(
            self._settings.wheel,
            self._soil(value, True),
            motion,
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
        # at rest and lifted the motor current alone tells something
        driving = (np.asarray(motion.wheel_speed) != 0.0) & (np.asarray(motion.load) > 0.0)
        return Foreseen(compared, {c: driving | (c == "torque") for c in self._channels})

    def _begins(self, near: Near, in_both: Collection[str]) -> Sequence[Driven]:
        """What predictions near by begin at: derivatives ask for the same again and again."""
        u, effects = near
        asked = self._near
        if asked is None or asked[0] is not u or asked[1:] != (effects, in_both):
            self._near = u, effects, in_both
            self._driven_near = self._driven(self._values(u), effects, in_both)
        return self._driven_near

    def _driven(
        self, value: Mapping[str, float], effects: Sequence[Effect], in_both: Collection[str]
    ) -> list[Driven]:
        """What the readings of each campaign depend on."""
        baseline = self._baseline(value)
        # relative error of each set of weights for itself, the last of values without one
        own = np.array([*(value[name] for name in self._data.sets.names), 0.0])
        return [
            Driven(
                self._soil(value, new),
                1.0 + value["weights"] + own[self._data.set_of(new)],
                1.0 + value["carriage_scale"],
                (*baseline, *(e for e in effects if new or e.name in in_both)),
            )
            for new, _ in self._campaigns
        ]

    def _values(self, u: Array) -> dict[str, float]:
        return {c.name: c.of(float(x)) for c, x in zip(self._constants, u, strict=True)}

    def _baseline(self, value: Mapping[str, float]) -> tuple[Effect, ...]:
        return tuple(
            make(e.name, {p: value.get(f"{e.name}.{p}", q.value) for p, q in e.parameters.items()})
            for e in self._settings.effects
        )

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
