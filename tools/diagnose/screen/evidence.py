"""One pass: the evidence of every effect beside a fit, by linear algebra.

The recordings may be explained by the discrepancy of form alone or with an effect of any shape j
and any size s of the discrepancy,

    E(effect) = ln Σ_{j, s} exp[e₀(s) + ln B(A_j(s), b_j(s))] / shapes,

against E = ln Σ_s exp e₀(s) without it. A discrepancy that was learnt without an effect may have
taken the effect's part: so smaller ones count too, at what they cost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from gritd.estimator.effects.base import Effect, order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes, log_evidence, log_sum
from gritd.tools.diagnose.fit.form_error import varied_along_place
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.signatures import shape_grid, signature, some_of, strengths
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.screen.gram import Gram
from gritd.tools.diagnose.screen.ripples import loudest
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True, eq=False)
class Weighed:
    """An effect of one shape beside a fit.

    evidence: log evidence summed over the sizes of the discrepancy [nats].
    exact:    log Bayes factor beside the model without a discrepancy.
    start:    of its parameters (p,), in expected sizes, where a fit begins; sizes: of the
        discrepancy, and of other forms of the fit's effects, beside which it is likeliest.
    """

    signature: Signature
    evidence: float
    exact: float
    start: Array
    sizes: Chosen


@dataclass(frozen=True, eq=False)
class Pass:
    """alone: log evidence of the fit; effects: of each effect its shapes, the likeliest first."""

    alone: float
    effects: Mapping[str, Sequence[Weighed]]

    def evidence(self, name: str) -> float:
        """Log evidence of an effect, averaged over the shapes that were tried."""
        every = self.effects[name]
        return float(log_sum([one.evidence + one.signature.prior for one in every]))

    @property
    def most(self) -> float:
        """Log evidence of the likeliest effect, or of the fit alone."""
        return max(map(self.evidence, self.effects), default=self.alone)

    def exact(self, name: str) -> float:
        """Log Bayes factor beside the model without a discrepancy, averaged likewise."""
        return float(log_sum([one.exact + one.signature.prior for one in self.effects[name]]))

    def gain(self, name: str) -> float:
        """The same beyond that of the fit alone [nats]."""
        return self.evidence(name) - self.alone


Shapes = Mapping[str, Sequence[Mapping[str, float]]]


def one_pass(problem: Problem, model: Model, jobs: int = 1) -> Pass:
    """Every effect of every shape beside a model without effects.

    jobs: processes.
    """
    tried, gram = every_shape(problem, model), Gram(problem, model)

    def weighed(names: Sequence[str]) -> list[tuple[str, list[Weighed]]]:
        made = [(n, attempted(partial(_weighed, problem, model, gram, n, tried[n]))) for n in names]
        return [(name, every) for name, every in made if every]

    parts = each(jobs, weighed, list(some_of(tried)))
    return Pass(gram.total, {name: every for part in parts for name, every in part})


def pass_beside(problem: Problem, model: Model, first: Pass) -> Pass:
    """Every effect that a model does not have beside it, by the columns of a first pass."""
    gram, effects = Gram(problem, model), {}
    for name in (n for n in first.effects if n not in model.names):
        kept = [one.signature for one in first.effects[name][: TUNING.search.again]]
        effect = problem.stack.rig.effects[name]
        effects[name] = _in_order(_of_signatures(problem, gram, effect, kept, kept[0].prior))
    return Pass(gram.total, effects)


@dataclass(frozen=True, eq=False)
class Together:
    """Two effects beside a fit, each of its likeliest shape.

    evidence: log evidence summed over the sizes of the discrepancy [nats]; each: where it begins
    beside the other.
    """

    evidence: float
    each: tuple[Weighed, Weighed]


def pairs_beside(problem: Problem, model: Model, first: Pass, most: int) -> list[Together]:
    """Of all pairs of effects those that are likeliest beside a model, from one matrix of products:
    of two effects each may hide the other. Where one promises little beside the other it is no
    pair.
    """
    every = [shapes[0] for shapes in first.effects.values()]
    columns = np.column_stack([one.signature.columns for one in every])
    counts = [len(one.signature.sign) for one in every]
    own = np.split(np.arange(sum(counts)), np.cumsum(counts)[:-1])
    gram = Gram(problem, model)
    a, b = gram.project(whiten(problem.noise, columns))

    def each_size(*some: int) -> Array:
        """Log evidence (s,) of some of them beside each size of the discrepancy."""
        index = np.concatenate([own[k] for k in some])
        sign = [side for k in some for side in every[k].signature.sign]
        return gram.evidence + log_evidence(a[:, index[:, None], index], b[:, index], sign)

    def together(i: int, j: int) -> Together:
        evidence, both = each_size(i, j), np.concatenate((own[i], own[j]))
        best = int(np.argmax(evidence))
        amplitude = _amplitude(a[best][np.ix_(both, both)], b[best, both])
        sizes, parts = gram.sizes[best].chosen, np.split(amplitude, [counts[i]])
        begun = [_begun(problem, every[k], x, sizes) for k, x in zip((i, j), parts, strict=True)]
        return Together(float(log_sum(evidence)), (begun[0], begun[1]))

    alone = [float(log_sum(each_size(k))) for k in range(len(every))]
    pairs = {p: float(log_sum(each_size(*p))) for p in combinations(range(len(every)), 2)}
    likely = sorted(pairs, key=lambda pair: -pairs[pair])[:most]
    little = TUNING.search.little
    return [together(i, j) for i, j in likely if pairs[i, j] > max(alone[i], alone[j]) + little]


def _begun(problem: Problem, one: Weighed, amplitude: Array, sizes: Chosen) -> Weighed:
    """An effect at other strengths (p,), beside other sizes of the discrepancy."""
    effect = problem.stack.rig.effects[str(one.signature.of)]
    return replace(one, start=_start(effect, one.signature, amplitude), sizes=sizes)


def varied_pass(problem: Problem, model: Model, first: Pass, jobs: int = 1) -> Pass:
    """A pass in which one strength of each effect may vary along the bed, by `form_error.py`:
    where soil takes the mean of an effect, what varies about it tells the strength.

    jobs: processes.
    """
    gram, names = Gram(problem, model), list(first.effects)

    def weighed(some: Sequence[str]) -> list[tuple[str, list[Weighed]]]:
        made = ((n, _varied(problem, gram, first.effects[n][0])) for n in some)
        return [(name, [*every, *first.effects[name]]) for name, every in made]

    parts = each(jobs, weighed, list(some_of(names)))
    return Pass(first.alone, {n: _in_order(every) for part in parts for n, every in part})


def _varied(problem: Problem, gram: Gram, one: Weighed) -> list[Weighed]:
    """An effect at its likeliest shape, one strength along the bed."""
    made, stack = one.signature, problem.stack
    effect = stack.rig.effects[str(made.of)]
    waves = varied_along_place(stack, effect, made)
    if not waves:
        return []
    a, b = gram.project(whiten(problem.noise, np.column_stack((made.columns, *waves))))
    count, out = len(made.sign), []
    prior = float(np.log(TUNING.fit.place_prior[-1]))
    for number in range(count):
        first = count + sum(w.shape[1] for w in waves[:number])
        along = np.arange(first, first + waves[number].shape[1])
        index = np.concatenate((np.arange(count), along))
        own, right = a[:, index[:, None], index], b[:, index]
        sign = (*made.sign, *(0 for _ in along))

        bayes = prior + log_bayes(own, right, sign)
        each_size = gram.evidence + bayes
        best = int(np.argmax(each_size))
        amplitude = _amplitude(own[best], right[best])
        rms = float(np.sqrt(np.mean(amplitude[count:] ** 2)))
        amplitude = amplitude[:count]
        side = made.sign[number] or amplitude[number]
        amplitude[number] = np.copysign(max(abs(amplitude[number]), rms), side)

        total, exact = float(log_sum(each_size)), float(bayes[gram.exact])
        start = _start(effect, made, amplitude)
        out.append(Weighed(made, total, exact, start, gram.sizes[best].chosen))
    return out


def every_shape(problem: Problem, model: Model) -> Shapes:
    """Of every effect the shapes that these recordings may show; of ripples only those that the
    residual holds, the others' evidence being nil.
    """
    rig = problem.stack.rig
    out = {}
    for name, effect in rig.effects.items():
        tried, order = list(shape_grid(rig, effect)), order_of(effect)
        if order is not None and len(tried) > TUNING.screen.loudest:
            orders = sorted({fixed[order] for fixed in tried})
            loud = loudest(problem.stack, problem.noise, model.fitted.residual, orders)
            tried = [fixed for fixed in tried if fixed[order] in loud]
        out[name] = tried
    return out


def _weighed(
    problem: Problem,
    model: Model,
    gram: Gram,
    name: str,
    shapes: Sequence[Mapping[str, float]],
) -> list[Weighed]:
    """An effect of every shape that changes anything, the likeliest first."""
    effect, fitted = problem.stack.rig.effects[name], model.fitted
    prior = -float(np.log(max(len(shapes), 1)))
    every = []
    for some in some_of(shapes):
        made = [
            signature(problem.stack, fitted.u, fitted.predicted, effect, fixed, fitted.acting)
            for fixed in some
        ]
        kept = [s for s in made if s is not None]
        if kept:
            every += _of_signatures(problem, gram, effect, kept, prior)
    return _in_order(every)


def _in_order(every: Iterable[Weighed]) -> list[Weighed]:
    """The likeliest first."""
    return sorted(every, key=lambda one: -one.evidence)


def _of_signatures(
    problem: Problem, gram: Gram, effect: type[Effect], made: Sequence[Signature], prior: float
) -> list[Weighed]:
    a, b = gram.project(whiten(problem.noise, np.column_stack([s.columns for s in made])))
    out, first = [], 0
    for one in made:
        own = slice(first, first + len(one.sign))
        first = own.stop
        bayes = log_evidence(a[:, own, own], b[:, own], one.sign)
        each_size = gram.evidence + bayes
        best = int(np.argmax(each_size))
        start = _start(effect, one, _amplitude(a[best, own, own], b[best, own]))
        kept = Signature(one.of, one.columns, one.sign, one.fixed, prior)
        total, exact = float(log_sum(each_size)), float(bayes[gram.exact])
        out.append(Weighed(kept, total, exact, start, gram.sizes[best].chosen))
    return out


def _amplitude(a: Array, b: Array) -> Array:
    """Linear estimate of strengths (p,)."""
    return np.asarray(np.linalg.solve(a + TUNING.numerics.least_precision * np.eye(len(b)), b))


def _start(effect: type[Effect], made: Signature, amplitude: Array) -> Array:
    """Where the fit of an effect's parameters begins: strengths at their linear estimate (p,)."""
    least = np.maximum(amplitude, TUNING.numerics.least_start)
    amplitude = np.where(np.array(made.sign) > 0, least, amplitude)

    size = dict(zip((p.name for p in strengths(effect)), amplitude.tolist(), strict=True))
    values = [
        size[p.name] if p.name in size else (made.fixed[p.name] - p.centre) / p.sigma
        for p in effect.parameters()
    ]
    far = TUNING.numerics.farthest_start
    return np.asarray(np.clip(np.array(values), -far, far))
