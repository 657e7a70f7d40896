"""Whether an effect explains the recordings, or a few stretches of them.

The evidence of an effect adds up over all values as if the rest of the model were exact. It is not,
and a peculiar stretch can pay for an effect that is not there. So each effect of a likely model is
judged once more by prediction: every run is cut into stretches, each stretch is predicted by the
model with and without the effect as the other stretches tell them, and the gains are added without
those of the two stretches where the effect gains most and the two where it loses most. What is
there gains elsewhere too, and no formula of it is right everywhere (leave-one-group-out prediction:
Vehtari, Gelman and Gabry 2017, Stat. Comput. 27, 1413-1432).

Calibrations are measurements too. Where motor and axle torque are both measured, a loss of the
drive may pass for an offset between the two, far from what is known of it, and every stretch is
predicted as well. No soil acts there. And an effect of a sensor, as an error of the torque
constant, does what a calibration does: without it the calibration strains, and every stretch is
predicted as well. So what such effects gain in the calibrations is added. For effects of the soil
it is not: where soil acts, calibrations strain because the form of its model is off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.heldout import held_out
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.search.search import Search, shared, without
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN


class Breadth:
    """The test, for the models of one search."""

    def __init__(self, search: Search, jobs: int = 1) -> None:
        """jobs: processes."""
        self._search, self._jobs = search, jobs
        self._stretches = stretches(search.problem.stack)
        self._density: dict[Model, Array] = {}
        self._less: dict[tuple[Model, str], Model] = {}

    def evidence(self) -> Mapping[Model, float]:
        """Of every model of the search, its evidence beyond what a reference shows; minus infinity
        for a model with an effect that is not broad.
        """
        counted = {model: self._search.news(model) for model in self._search.models}
        if self._jobs > 1:
            self._prepare([m for m in self._search.models[1:] if self._matters(m, counted)])
        for model in sorted(self._search.models[1:], key=lambda m: -self._search.weight(m)):
            tested = self._matters(model, counted)
            if tested and not attempted(partial(self._all_broad, model)):
                counted[model] = -np.inf
        return counted

    def _all_broad(self, model: Model) -> bool:
        return all(self.broad(model, name) for name in model.names)

    def broad(self, model: Model, name: str) -> bool:
        """Whether an effect of a model gains in more than two stretches, or relieves calibrations
        of a strain.
        """
        gains, apart = np.sort(self.gains(model, name)), TUNING.verdict.stretches_apart
        rest = gains[apart:-apart]
        if not rest.size:
            return True
        return bool(rest.sum() + self.relieved(model, name) > TUNING.verdict.broad)

    def gains(self, model: Model, name: str) -> Array:
        """Log density (b,) of each stretch given the others, above that without the effect."""
        return self._predicted(model) - self._predicted(self.without(model, name))

    def relieved(self, model: Model, name: str) -> float:
        """By how much nearer the calibrations stand to what is known of them [nats, not below 0]
        than without an effect of a sensor, or of the drive where its loss is measured.
        """
        rig = self._search.problem.stack.rig
        stages = {"sensor", "drivetrain"} if any(form.drive for form in rig.forms) else {"sensor"}
        if rig.effects[name].stage not in stages:
            return 0.0

        known = np.array([not c.soil for c in rig.constants])
        strains = (m.fitted.u[known] for m in (self.without(model, name), model))
        before, after = (0.5 * float(u @ u) for u in strains)
        return max(before - after, 0.0)

    def without(self, model: Model, name: str) -> Model:
        """The model less one of its effects."""
        if (model, name) not in self._less:
            self._less[model, name] = self._fitted_without((model, name))
        return self._less[model, name]

    def _prepare(self, models: Sequence[Model]) -> None:
        """All such models of some models, side by side."""
        wanted = [(model, name) for model in models for name in model.names]
        made = each(self._jobs, self._fitted_without, wanted, shared(self._search))
        self._less.update(zip(wanted, made, strict=True))

    def _fitted_without(self, of: tuple[Model, str]) -> Model:
        with self._search.problem.stack.rig.aside():  # the same bits, whatever was fitted before
            return without(self._search, *of)

    def _matters(self, model: Model, counted: Mapping[Model, float]) -> bool:
        """Whether the model is nearly as likely as the best one so far, as they count."""
        search = self._search
        best = max(search.weight(m) - search.news(m) + counted[m] for m in search.models[1:])
        return search.weight(model) > best - TUNING.search.little

    def _predicted(self, model: Model) -> Array:
        if model not in self._density:
            self._density[model] = held_out(model.fitted, self._stretches).log_density
        return self._density[model]


def stretches(stack: Stack) -> list[Bools]:
    """Marks (N,) of equal parts of the runs in which candidates act, in time."""
    runs = np.flatnonzero(stack.rig.new)
    count = max(-(-TUNING.verdict.stretches // len(runs)), TUNING.verdict.stretches_of_a_run)
    marks = []

    for number in runs:
        own = stack.run == number
        if not own.any():
            continue
        first, last = stack.time[own].min(), stack.time[own].max()
        share = (stack.time - first) / max(float(last - first), SPAN)
        part = np.minimum((count * share).astype(int), count - 1)
        marks += [own & (part == k) for k in range(count)]

    return [part for part in marks if part.any()]
