"""The filter run again over what it remembers, and what is done with the memory where a stretch
ends.
"""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bank import Bank, leading
from gritd.estimator.filter.change import Judgement, judge
from gritd.estimator.filter.engine import Engine
from gritd.estimator.filter.estimate import (
    KPA,
    STATES,
    Estimate,
    Update,
    Vector,
    predict,
)
from gritd.estimator.filter.line import Line, line_of
from gritd.estimator.filter.measurement import Measurement
from gritd.estimator.filter.segments import CAPACITY, Memory, Stretch
from gritd.estimator.filter.tuning import FORM


class Smoother:
    """The settings turned into passes over a memory; it holds no state."""

    def __init__(
        self, settings: Settings, measurement: Measurement, engine: Engine, prior: Estimate
    ) -> None:
        self._measurement = measurement
        self._engine = engine
        self._prior = prior.x[:STATES]
        self.prior_sigma = tuple([prior.soil_P[i][i] ** 0.5 for i in range(STATES)])
        self._radius = measurement.chain.wheel.radius
        walk = settings.filter
        self._rates = (walk.cohesion_walk / KPA, walk.tan_phi_walk, walk.ln_k_walk)

    def walked(self, estimate: Estimate, elapsed: float, unrest: float) -> Estimate:
        """Random walk of the soil over the elapsed time [s]; unrest: more of it after a change,
        [prior σ/√s].
        """
        return predict(estimate, self._walk(elapsed, unrest))

    def _walk(self, elapsed: float, unrest: float) -> Vector:
        rates = zip(self._rates, self.prior_sigma, strict=True)
        return tuple([(rate * rate + (unrest * sigma) ** 2) * elapsed for rate, sigma in rates])

    def with_open(self, memory: Memory, base: Bank, x: Vector, doubt: float) -> tuple[Memory, Bank]:
        """The memory whose open stretch has its tangent at x (d,), and what it leaves on top of
        `base`.
        """
        *before, last = memory.stretches
        last = last._replace(line=self._tangent(last, x))
        last, bank = self._absorbed(base, last, doubt)
        return memory._replace(stretches=(*before, last)), bank

    def completed(self, memory: Memory, doubt: float) -> Memory:
        """The stretch before the last is complete. The oldest goes to the anchor when there are too
        many.
        """
        memory = memory.aged(self._radius)
        if len(memory.stretches) > CAPACITY:
            memory = memory.crowded(self._radius)
        if len(memory.stretches) <= CAPACITY:
            return memory

        oldest, *rest = memory.stretches
        _, anchor = self._absorbed(memory.anchor, oldest, doubt)
        return memory._replace(anchor=anchor, stretches=tuple(rest))

    def judgement(self, memory: Memory, bank: Bank, doubt: float) -> Judgement | None:
        """What the complete stretches on the present soil say of it, by the most probable member of
        the bank; None where there is none.
        """
        complete = memory.complete()
        if not complete:
            return None
        first = memory.stretches[memory.since]
        before = (memory.anchor if first.changed is None else first.changed)[leading(bank)]
        lines = [stretch.line for stretch in complete if stretch.line is not None]
        windows = [stretch.windows for stretch in complete]
        return judge(before, self._doubted(doubt), lines, windows, FORM.usual)

    def tangents(self, stretches: Sequence[Stretch], x: Vector) -> tuple[Line, ...]:
        """Stretches along the tangents at x (3,)."""
        return tuple([self._tangent(stretch, x) for stretch in stretches])

    def _tangent(self, stretch: Stretch, x: Vector) -> Line:
        return line_of(self._measurement, stretch.mean, stretch.by_parameters, x)

    def over(
        self, bank: Bank, stretches: Sequence[Stretch], doubt: float
    ) -> tuple[tuple[Stretch, ...], Bank]:
        """The filter over stretches that have their tangents; where the soil changed, a stretch
        notes what is still known.
        """
        passed = []
        for stretch in stretches:
            stretch, bank = self._absorbed(bank, stretch, doubt)
            passed.append(stretch)
        return tuple(passed), bank

    def _absorbed(self, bank: Bank, stretch: Stretch, doubt: float) -> tuple[Stretch, Bank]:
        """Update with a whole stretch."""
        walk = self._walk(stretch.elapsed, stretch.unrest)
        bank = tuple([predict(member, walk) for member in bank])
        if stretch.changed is not None:
            bank = tuple([self.renewed(member, doubt) for member in bank])
            stretch = stretch._replace(changed=bank)
        if not stretch.components or not stretch.judged:
            return stretch, bank

        line = stretch.line
        assert line is not None
        noises = {size: line.noise(stretch.windows, size) for size in set(FORM.own)}
        after = []
        for member, size in zip(bank, FORM.own, strict=True):
            update = Update(line.innovation(member.x), line.H, noises[size])
            after.append(self._engine.update(member, update.of(stretch.components)))
        return stretch, tuple(after)

    def _doubted(self, doubt: float) -> Vector:
        """The prior's σ (3,), so many times."""
        return tuple([doubt * sigma for sigma in self.prior_sigma])

    def renewed(self, estimate: Estimate, doubt: float = 1.0) -> Estimate:
        """Another soil is the one before, and a change of the prior's size: what change.py weighs.
        What is known of the errors that all windows share stays.
        """
        return predict(estimate, tuple([sigma * sigma for sigma in self._doubted(doubt)]))
