"""The filter run again over what it remembers, and what is done with the memory where a stretch
ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.change import Judgement, judge
from gritd.estimator.filter.engine import Engine
from gritd.estimator.filter.estimate import (
    KPA,
    STATES,
    Estimate,
    Vector,
    predict,
)
from gritd.estimator.filter.line import Line, line_of
from gritd.estimator.filter.measurement import Measurement, selected
from gritd.estimator.filter.segments import CAPACITY, Memory, Stretch


class Smoother:
    """The settings turned into passes over a memory; it holds no state."""

    def __init__(
        self, settings: Settings, measurement: Measurement, engine: Engine, prior_sigma: Vector
    ) -> None:
        self._measurement = measurement
        self._engine = engine
        self.prior_sigma = prior_sigma
        self._radius = measurement.chain.wheel.radius
        walk = settings.filter
        self._rates = (walk.cohesion_walk / KPA, walk.tan_phi_walk, walk.ln_k_walk)

    def walked(self, estimate: Estimate, elapsed: float, unrest: float) -> Estimate:
        """Random walk of the soil over the elapsed time [s]; unrest: more of it after a change,
        [prior σ/√s].
        """
        rates = zip(self._rates, self.prior_sigma, strict=True)
        return predict(
            estimate,
            tuple([(rate * rate + (unrest * sigma) ** 2) * elapsed for rate, sigma in rates]),
        )

    def completed(self, memory: Memory, x: Vector, consider_k: bool, doubt: float) -> Memory:
        """The stretch before the last is complete: a measurement along the tangent at x. The oldest
        goes to the anchor when there are too many.
        """
        if len(memory.stretches) < 2:
            return memory

        *before, done, last = memory.stretches
        done = done._replace(line=line_of(self._measurement, done.mean, x))
        memory = memory._replace(stretches=(*before, done, last)).aged(self._radius)
        if len(memory.stretches) <= CAPACITY:
            return memory

        oldest, *rest = memory.stretches
        _, anchor = self._absorbed(memory.anchor, oldest, consider_k, doubt)
        return Memory(anchor, tuple(rest))

    def judgement(self, memory: Memory, doubt: float) -> Judgement | None:
        """What the complete stretches on the present soil say of it; None where there is none."""
        told = memory.complete()
        if not told:
            return None
        first = memory.stretches[memory.since]
        before = memory.anchor if first.changed is None else first.changed
        lines = [stretch.line for stretch in told if stretch.line is not None]
        variances, windows = self._measurement.variances, [stretch.windows for stretch in told]
        return judge(before, variances, self._doubted(doubt), lines, windows)

    def tangents(self, stretches: Sequence[Stretch], x: Vector) -> tuple[Line, ...]:
        """Stretches along the tangents at x (3,)."""
        return tuple([line_of(self._measurement, stretch.mean, x) for stretch in stretches])

    def over(
        self, estimate: Estimate, stretches: Sequence[Stretch], consider_k: bool, doubt: float
    ) -> tuple[tuple[Stretch, ...], Estimate]:
        """The filter over stretches that have their tangents; where the soil changed, a stretch
        notes what is still known.
        """
        passed = []
        for stretch in stretches:
            stretch, estimate = self._absorbed(estimate, stretch, consider_k, doubt)
            passed.append(stretch)
        return tuple(passed), estimate

    def _absorbed(
        self, estimate: Estimate, stretch: Stretch, consider_k: bool, doubt: float
    ) -> tuple[Stretch, Estimate]:
        """Update with a whole stretch."""
        estimate = self.walked(estimate, stretch.elapsed, stretch.unrest)
        if stretch.changed is not None:
            estimate = self.widened(estimate, doubt)
            stretch = stretch._replace(changed=estimate)
        if not stretch.components:
            return stretch, estimate

        assert stretch.line is not None
        update = selected(stretch.line.update(estimate.x, stretch.windows), stretch.components)
        return stretch, self._engine.update(estimate, update, consider_k)

    def _doubted(self, doubt: float) -> Vector:
        """The prior's σ (3,), so many times."""
        return tuple([doubt * sigma for sigma in self.prior_sigma])

    def widened(self, estimate: Estimate, doubt: float = 1.0) -> Estimate:
        """As uncertain as the prior, about where it is; its correlation with the calibration errors
        stays.
        """
        P = np.array(estimate.P)
        more = np.diag(np.square(self._doubted(doubt))) - P
        if np.linalg.eigvalsh(more)[0] < 0.0:  # somewhere it is wider already
            more = np.diag(np.maximum(np.diag(more), 0.0))
        wide = (P + more).tolist()
        rows = tuple(tuple(row[:STATES]) for row in wide)
        return Estimate(estimate.x, rows, estimate.cross)
