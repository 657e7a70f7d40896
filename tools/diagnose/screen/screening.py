"""What is looked for beside a fitted model, and whether anything is amiss at all.

The recordings are explained by the exact model, or by its discrepancy of form δ, or with one of the
listed effects, or with something that has no name: a function of time or place, a wave, a step.
With the evidence Z of each,

    alarm = ln [(Z_δ + mean Z_effect + mean Z_unexplained) / 3] − ln Z_exact.

The chance of a likelihood ratio above R by noise alone is 1/R at most (Markov's inequality), so
ln 100 is an alarm that is false once in a hundred campaigns. An effect is tried beside the exact
model too. Where δ is known to be there, as the configuration holds one that was learnt or a
reference campaign shows it, the alarm is that of effects and the unexplained against Z_δ, each less
what the runs of the reference would raise of its kind (usual.py). Without a reference, which shows
the noise, something of it must be more than noise of any colour as well (open_colour.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.discrepancy import usual_sizes
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes, log_sum
from gritd.tools.diagnose.fit.functions import BEYOND_FORM, smooth_signatures
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.random_effect import RandomEffect
from gritd.tools.diagnose.fit.shape import Candidate, Shape
from gritd.tools.diagnose.fit.signatures import some_of
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.screen.evidence import Pass, one_pass
from gritd.tools.diagnose.screen.gram import Gram
from gritd.tools.diagnose.screen.open_colour import OpenNoise
from gritd.tools.diagnose.screen.scans import Family, candidates, families, without_harmonics
from gritd.tools.diagnose.screen.usual import EFFECTS, UNEXPLAINED, kinds_of, unnamed_in_both, usual
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True)
class Screening:
    """All that may be amiss beside the effects.

    base: exact in its form; forms: what the form of the model may be off by; functions: smooth
    unexplained terms; families: unexplained waves and steps; usual: (q,) constants as a reference
    alone tells them, where fits of what is new begin.
    """

    problem: Problem
    base: Model
    forms: tuple[RandomEffect, ...]
    functions: tuple[Signature, ...]
    families: tuple[Family, ...]
    usual: Array | None = None

    @property
    def beyond_form(self) -> list[Signature]:
        """Smooth functions that the form of the model cannot be; of a new campaign beside its
        reference all.
        """
        if self.problem.stack.referred:
            return list(self.functions)
        sources = self.problem.stack.rig.forms
        formed = {channel for source in sources for channel in source.channels}
        return [
            s
            for s in self.functions
            if s.shape.channel not in formed or set(s.shape.along) <= BEYOND_FORM
        ]

    def shapes(self, model: Model) -> list[Signature]:
        """What the form of the model cannot be: smooth functions of time and place, and the
        likeliest waves and steps beside a model.
        """
        beside = without_harmonics(self.problem, model.fitted)
        return [*self.beyond_form, *candidates(self.families, self.problem, beside)]


def prepare_screening(base: BaseFit) -> Screening:
    """Everything that screens of any model share."""
    problem = base.problem
    return Screening(
        problem,
        base.model,
        base.forms,
        smooth_signatures(problem.stack),
        families(problem.stack, problem.noise),
        base.usual,
    )


@dataclass(frozen=True, eq=False)
class Screen:
    """effects: beside the model with its discrepancy; unexplained: log Bayes factor of what has no
    name, beside the same [nats].

    exact:  log evidence of the model that is taken for right where nothing is amiss.
    formed: whether its discrepancy is none of the alarm.
    ripple: chance of the likeliest new ripple that the recordings show at their own rate.
    strain: [σ] of the constant that stands farthest from what is known of it, and its name.
    kind:   of every effect beside a reference; else all are of one.
    usual:  of every kind what a run of a reference would raise [nats] (usual.py).
    open:   the largest log Bayes factor of what stands out with the noise's colour open [nats].
    """

    effects: Pass
    unexplained: Mapping[Shape, float]
    exact: float
    formed: bool
    ripple: float
    strain: float
    kind: Mapping[str, str] = field(default_factory=dict)
    usual: Mapping[str, float] = field(default_factory=dict)
    constant: str = ""
    open: float = np.inf

    @property
    def evidence(self) -> dict[Candidate, float]:
        """Log Bayes factor of every candidate beside the discrepancy of form [nats]."""
        effects: dict[Candidate, float] = {n: self.effects.gain(n) for n in self.effects.effects}
        return effects | dict(self.unexplained)

    @property
    def best(self) -> dict[str, Signature]:
        """The likeliest signature of every effect."""
        return {name: every[0].signature for name, every in self.effects.effects.items()}

    @property
    def ratio(self) -> float:
        """The alarm [nats]."""
        means = [value for value in self.kinds.values()]
        return float(log_sum(means) - np.log(len(means)) - self.exact) if means else 0.0

    @property
    def kinds(self) -> dict[str, float]:
        """Mean log evidence of every kind of explanation that is not the exact model, less what is
        usual of the kind [nats].
        """
        alone = self.effects.alone
        kinds = {
            "form": [alone],
            UNEXPLAINED: [alone + value for value in self.unexplained.values()],
        }
        for name in self.effects.effects:
            kinds.setdefault(self._kind(name), []).append(self.effects.evidence(name))
            if not self.formed:
                exact = self.exact + self.effects.exact(name)
                kinds.setdefault("effects of the exact", []).append(exact)
        means = {k: float(log_sum(each)) - np.log(len(each)) for k, each in kinds.items() if each}
        return {k: mean - self.usual.get(k, 0.0) for k, mean in means.items()}

    def _kind(self, name: str) -> str:
        return self.kind.get(name, EFFECTS)

    @property
    def largest(self) -> Candidate:
        """What is likeliest to be amiss: a candidate, or the constant that strains more."""
        evidence = self.evidence
        if self.constant and 0.5 * self.strain**2 > max(evidence.values(), default=0.0):
            return Shape(self.constant, (self.constant,), "strain")
        return max(evidence, key=lambda of: evidence[of], default="nothing")

    @property
    def threshold(self) -> float:
        """What the alarm must reach [nats]."""
        return -float(np.log(TUNING.screen.level))

    def seen(self, name: str, evidence: float) -> bool:
        """Whether an effect of so much evidence would be an alarm."""
        kind = self._kind(name)
        count = len(self.kinds) * sum(self._kind(other) == kind for other in self.effects.effects)
        return evidence - self.usual.get(kind, 0.0) > self.threshold + float(np.log(count))

    @property
    def p(self) -> float:
        """The largest chance that noise alone could give of what is seen."""
        beyond = max(self.ratio, 0.0)
        open_ = min(TUNING.screen.kinds * float(np.exp(-max(self.open, 0.0))), 1.0)
        return float(min(max(np.exp(-beyond), open_), self.ripple, self.strained))

    @property
    def strained(self) -> float:
        """Chance of a constant as far from what is known of it, in any of so many kinds."""
        far = 2.0 * float(ndtr(-self.strain))
        return min(TUNING.screen.kinds * far, 1.0) if self.strain > TUNING.rig.doubt else 1.0

    @property
    def on_grid(self) -> bool:
        """Whether something stands out on the grid, or a constant strains beyond belief."""
        outstanding = self.ratio > self.threshold and self.open > TUNING.screen.sure
        return outstanding or self.strain > TUNING.rig.doubt

    @property
    def alarmed(self) -> bool:
        """Whether something stands out on the grid, or a ripple at the recordings' own rate."""
        return self.on_grid or self.ripple < TUNING.screen.line


def screen(screening: Screening, bare: Model, jobs: int = 1) -> Screen:
    """The pass over every effect, and what has no name, beside the model with its discrepancy.

    jobs: processes.
    """
    problem, rig = screening.problem, screening.problem.stack.rig
    effects = one_pass(problem, bare, jobs=jobs)
    formed = problem.stack.referred or rig.held is not None
    exact = _exact(screening, bare)
    unexplained = _unexplained(screening, bare)
    ripple = min((line.p for line in rig.lines.fresh()), default=1.0)
    strained = bare if formed else screening.base
    strain, constant = strain_of(problem, strained)
    found = Screen(effects, unexplained, exact, formed, ripple, strain, constant=constant)
    if problem.stack.referred:
        found = replace(found, kind=kinds_of(rig), usual=usual(problem, bare, effects))
    if not found.on_grid or problem.stack.referred or rig.tabled:
        return found
    return replace(found, open=_open(screening, bare, found, jobs))


def _open(screening: Screening, bare: Model, found: Screen, jobs: int) -> float:
    """The evidence beside the base model of what stands out beside the bare one, with the noise's
    colour open [nats]; one that is enough ends the search. What is likeliest with one colour need
    not be what slow noise cannot be, so all are weighed.

    jobs: processes.
    """
    shapes = [(s.shape.family, s) for s in screening.shapes(bare)]
    every: list[tuple[Candidate, Signature]] = [*found.best.items(), *shapes]
    ranked = sorted(every, key=lambda one: -found.evidence[one[0]])
    standing = [s for of, s in ranked if found.evidence[of] > 0.0]

    most = -np.inf
    for some in some_of(standing):
        weighed = OpenNoise(screening.problem, screening.base.fitted, some, jobs)
        for number in range(len(some)):
            most = max(most, weighed.gain(number))
            if most > TUNING.screen.sure:
                return most
    return most


def _exact(screening: Screening, bare: Model) -> float:
    """Log evidence where nothing is amiss: of the exact model, or of a discrepancy that is known
    to be there and no larger than is known; beside a reference also of what both campaigns show.
    """
    problem, forms = screening.problem, screening.forms
    if not (problem.stack.referred or problem.stack.rig.held is not None):
        return Gram(problem, screening.base).total

    known = Gram(problem, bare).up_to(usual_sizes(problem.stack, forms, bare))
    if not problem.stack.referred:
        return known
    both = unnamed_in_both(problem, bare, screening.beyond_form, screening.families)
    return known + float(np.logaddexp(0.0, both) - np.log(2.0))


def strain_of(problem: Problem, model: Model) -> tuple[float, str]:
    """How far the farthest constant of a fit stands from what is known of it [σ], and its name;
    beside a reference, of those that tell what is new.
    """
    constants, referred = problem.stack.rig.constants, problem.stack.referred
    pairs = zip(constants, np.abs(model.fitted.u).tolist(), strict=True)
    each = [(u, c.name) for c, u in pairs if c.changes or not referred]
    return max(each, default=(0.0, ""))


def _unexplained(screening: Screening, model: Model) -> dict[Shape, float]:
    """Log Bayes factor of every function, and of every family of waves or steps, averaged over
    where they may be.
    """
    beside = without_harmonics(screening.problem, model.fitted)
    out = {family.shape: family.average(beside) for family in screening.families}

    functions = screening.beyond_form
    if functions:
        columns = whiten(screening.problem.noise, np.column_stack([s.columns for s in functions]))
        a, b = model.fitted.projection().project(columns)
        out |= {s.shape: _of(a, b, own) for s, own in _spans(functions)}
    return out


def _spans(functions: Sequence[Signature]) -> list[tuple[Signature, slice]]:
    ends = np.cumsum([s.columns.shape[1] for s in functions]).tolist()
    return [
        (s, slice(end - s.columns.shape[1], end)) for s, end in zip(functions, ends, strict=True)
    ]


def _of(a: Array, b: Array, own: slice) -> float:
    return float(log_bayes(a[own, own], b[own], (0,) * (own.stop - own.start)))
