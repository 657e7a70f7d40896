"""The recordings of a rig as one vector."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property

import numpy as np

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools, Channels, Index, Near, Rig


class Stack:
    """The used values of all channels and runs as one vector (N,): by channel, run, then time."""

    def __init__(self, rig: Rig, in_both: Collection[str] = ()) -> None:
        """in_both: names of effects that act in the reference campaign too."""
        self.rig, self.in_both = rig, in_both
        self.parts = [
            (channel, number) for channel in rig.channels for number in range(len(rig.runs))
        ]
        self._masks = [rig.runs[number].used[channel] for channel, number in self.parts]
        sizes = [int(mask.sum()) for mask in self._masks]
        self.channel: Index = np.repeat([rig.channels.index(c) for c, _ in self.parts], sizes)
        self.run: Index = np.repeat([number for _, number in self.parts], sizes)
        self.time: Array = self.joined([{c: run.time for c in rig.channels} for run in rig.runs])
        self.size = int(sum(sizes))

    def joined(self, values: Sequence[Channels]) -> Array:
        """Values (n,) per run and channel as one vector (N,)."""
        pieces = [values[n][c][mask] for (c, n), mask in zip(self.parts, self._masks, strict=True)]
        return np.concatenate(pieces) if pieces else np.zeros(0)

    def covariate(self, name: str) -> Array:
        """Of every value (N,), in the unit of the rig's `units`; run: the number of its run, from
        1, in order of time.
        """
        if name == "run":
            began = [run.time[0] for run in self.rig.runs]
            return (np.argsort(np.argsort(began, kind="stable"))[self.run] + 1).astype(float)
        return self._by_run([run.covariates[name] for run in self.rig.runs])

    def _by_run(self, values: Sequence[Array]) -> Array:
        """(N,) of values (n,) per run that all channels have."""
        return self.joined([dict.fromkeys(self.rig.channels, own) for own in values])

    @cached_property
    def measured(self) -> Array:
        """(N,) in the channels' units."""
        return self.joined([run.measured for run in self.rig.runs])

    @cached_property
    def new(self) -> Bools:
        """Values (N,) of runs in which candidates act."""
        acting: Bools = np.array(self.rig.new)[self.run]
        return acting

    @cached_property
    def idle(self) -> Bools:
        """Marks the values (N,) at which a torque is the motor's alone: see GridRun."""
        return self.of("torque") & (self._by_run([run.idle for run in self.rig.runs]) > 0.0)

    @cached_property
    def turned(self) -> Bools:
        """Marks the values (N,) after a reversal: see GridRun."""
        marked: Bools = self._by_run([run.turned for run in self.rig.runs]) > 0.0
        return marked

    @cached_property
    def motion_sigma(self) -> Array:
        """(N,) in the channels' units: see Rig.motion_sigma."""
        sigma = self.rig.motion_sigma
        return self.joined(sigma) if sigma else np.zeros(self.size)

    @cached_property
    def nuisances(self) -> Array:
        """Columns (N, k) in the channels' units: see Rig.nuisances; those that act."""
        return self._columns(self.rig.nuisances)

    @cached_property
    def named(self) -> Array:
        """Columns (N, k) in the channels' units: see Rig.named; those that act."""
        return self._columns(self.rig.named)

    @cached_property
    def doubts(self) -> Array:
        """Columns (N, k) in the channels' units: see Held.doubts; those that act."""
        return self._columns(self.rig.held.doubts if self.rig.held else ())

    def _columns(self, parts: Sequence[Sequence[Channels]]) -> Array:
        columns = [self.joined(part) for part in parts]
        return np.column_stack([np.zeros((self.size, 0)), *(c for c in columns if np.any(c))])

    @cached_property
    def gaps(self) -> Array:
        """Time (N,) since the value before in the same channel and run [s]; inf at the first."""
        return self.gaps_of(np.ones(self.size, bool))

    def gaps_of(self, kept: Bools) -> Array:
        """The same (n,), with only the n values kept that are marked (N,)."""
        gap = np.diff(self.time[kept], prepend=0.0)
        first = np.diff(self.channel[kept] * len(self.rig.runs) + self.run[kept], prepend=-1) != 0
        return np.where(first, np.inf, gap)

    def predict(
        self,
        u: Array,
        effects: Sequence[Effect] = (),
        everywhere: bool = False,
        near: Near | None = None,
    ) -> Array:
        """(N,) in the channels' units, for constants u (q,) in prior σ; everywhere: the effects act
        in the reference campaign too; near: see interface.Predict.
        """
        in_both = [effect.name for effect in effects] if everywhere else self.in_both
        return self.joined(self.rig.predict(u, effects, in_both, near))

    @cached_property
    def referred(self) -> bool:
        """Whether some runs are of a reference campaign."""
        return not all(self.rig.new)

    @cached_property
    def partial(self) -> dict[int, tuple[int, Array]]:
        """Of each constant of `rig.partial`: the constant that it is a part of, and its
        derivative's share of that one's (N,).
        """
        constants = self.rig.constants
        place = {constant.name: i for i, constant in enumerate(constants)}
        sigma = [constant.sigma for constant in constants]

        out = {}
        for name, (whole, masks) in self.rig.partial.items():
            share = sigma[place[name]] / sigma[place[whole]]
            marked = self._by_run([np.where(mask, share, 0.0) for mask in masks])
            out[place[name]] = place[whole], marked
        return out

    def by_channel(self, values: Array) -> Array:
        """Sums over the values (N, …) of each channel (channels, …)."""
        marks = np.array([self.of(channel) for channel in self.rig.channels], float)
        return np.asarray(marks @ values)

    def of(self, channel: str) -> Bools:
        """Marks the values of a channel (N,), which the rig may not have."""
        channels = self.rig.channels
        mask: Bools = self.channel == (channels.index(channel) if channel in channels else -1)
        return mask
