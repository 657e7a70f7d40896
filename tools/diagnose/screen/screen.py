"""The screen: evidence of every effect and of every smooth misfit at once, against what noise alone
would show.

Nulls are surrogates of the recordings' own noise (size and colour drawn from their posterior)
together with constants drawn from their priors; each goes through the same linear algebra. What
noise alone shows differs from name to name: a function of time takes slow noise for a drift, a
ripple does not. So each evidence is counted from where the last tenth of its own nulls begins, in
units of how far they reach beyond (never less than a nat), and the alarm is a quantile of the
largest of *all* these surprises in every null, however many were tried and however alike they are
(Westfall and Young 1993, Resampling-Based Multiple Testing).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.evidence import Signature, log_evidence, log_sum
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.fit.shape import Candidate, Shape
from gritd.tools.diagnose.fit.signatures import some_of
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SIZE


@dataclass(frozen=True)
class WhitenedSignature:
    """A signature in units of independent noise; its columns may have been left out where they
    vanish.
    """

    signature: Signature
    columns: Array


@dataclass(frozen=True)
class Screen:
    """Of every candidate beside one model its log Bayes factor, and the largest surprise of each
    null.

    usual:  where the last tenth of the candidate's own nulls begins, and how far they reach.
    best:   its likeliest signature.
    fixed:  of an effect, the values of its other parameters that were tried, the likeliest first.
    nulls:  (draws,) the largest surprise of all candidates.
    chance: of as much evidence by noise alone.
    open:   [nats] the evidence that is left with the noise's colour open (open_colour.py).
    asked:  [nats] that must be left of it; if nothing is given, a likelihood ratio that is chance
        as rarely as an alarm is false.
    ripple: chance of the likeliest new ripple that the recordings show at their own rate.
    counts: the share of evidence that counts beside a reference, or a discrepancy that was learnt:
        it was driven elsewhere too.
    strain: [σ] of the constant that stands farthest from what is known of it.
    habit:  the largest surprise of each candidate in a run of the reference (habit.py).
    apart:  candidates whose habit says nothing of others: a rig that ripples is off its model in
        nothing else.
    """

    evidence: dict[Candidate, float]
    usual: dict[Candidate, tuple[float, float]]
    best: dict[Candidate, Signature]
    fixed: dict[Candidate, list[dict[str, float]]]
    nulls: Array
    chance: dict[Candidate, float] = field(default_factory=dict)
    open: float = np.inf
    asked: float = field(default_factory=lambda: TUNING.screen.sure)
    habit: Mapping[Candidate, float] = field(default_factory=dict)
    apart: Collection[Candidate] = ()
    ripple: float = 1.0
    counts: float = 1.0
    strain: float = 0.0

    @property
    def listed(self) -> dict[str, float]:
        """The evidence of the effects alone."""
        return {n: e for n, e in self.evidence.items() if isinstance(n, str)}

    @property
    def nameless(self) -> dict[Shape, float]:
        """The evidence of misfits without a name alone."""
        return {n: e for n, e in self.evidence.items() if isinstance(n, Shape)}

    @property
    def threshold(self) -> float:
        """At the tail of the nulls, fitted and counted: whichever is farther, since a fitted tail
        may be too light. A rig that the reference shows to be off its model in some way may be off
        in another where it is driven otherwise.
        """
        counted = np.sort(self.nulls)[-max(int(TUNING.screen.level * (1 + len(self.nulls))), 1)]
        return max(
            float(tail_quantile(self.nulls, TUNING.screen.level)),
            float(counted),
            TUNING.screen.least_surprise,
            self.of_reference,
        )

    @property
    def of_reference(self) -> float:
        """What the largest surprise in a run of the reference asks of one that is news."""
        others = (value for of, value in self.habit.items() if of not in self.apart)
        return TUNING.screen.habit * max(others, default=0.0)

    def seen(self, of: Candidate, evidence: float) -> bool:
        """Whether a candidate of so much evidence would be an alarm."""
        counted = self.counts * evidence
        return self.surprise(of, counted) > self.threshold and counted > self.asked

    def surprise(self, of: Candidate, evidence: float | None = None) -> float:
        """How far evidence (that of the recordings if not given) lies beyond what noise shows for
        this candidate, and beyond what the reference shows of it.
        """
        start, reach = self.usual[of]
        evidence = self.evidence[of] if evidence is None else evidence
        return (evidence - start) / reach - TUNING.screen.habit * self.habit.get(of, 0.0)

    def beside_reference(
        self,
        evidence: Mapping[Candidate, float],
        asked: float,
        apart: Collection[Candidate] = (),
    ) -> Screen:
        """The same where single runs of a reference campaign show some evidence of the candidates
        [nats]; asked: [nats] that must be left; apart: those whose habit says nothing of others.
        """
        usual = {of: self.usual[of] for of in evidence if of in self.usual}
        habit = {of: max((evidence[of] - s) / r, 0.0) for of, (s, r) in usual.items()}
        return replace(self, habit=habit, apart=apart, asked=asked)

    @property
    def largest(self) -> tuple[Candidate, float]:
        """The most surprising candidate, and its surprise."""
        first = max(self.evidence, key=self.surprise)
        return first, self.surprise(first)

    @property
    def p(self) -> float:
        """Of the largest surprise, among the nulls; where it was weighed with the noise's colour
        open, no less than the chance of such a likelihood ratio in any kind of misfit (Markov's
        inequality). The same of what it lacks beside the reference: tails are exponential. A ripple
        at full rate has a chance of its own.
        """
        counted = float((1 + np.sum(self.nulls >= self.largest[1])) / (1 + len(self.nulls)))
        lacking = max(self.asked - max(self.open, 0.0), self.of_reference - self.largest[1])
        beyond = min(TUNING.screen.level * float(np.exp(lacking)), 1.0)
        return min(max(counted, beyond), self.ripple, self.strained)

    @property
    def strained(self) -> float:
        """Chance of a constant as far from what is known of it, in any of so many kinds."""
        far = 2.0 * float(ndtr(-self.strain))
        return min(TUNING.screen.kinds * far, 1.0) if self.strain > TUNING.screen.beyond else 1.0

    @property
    def stands_out(self) -> list[Candidate]:
        """Candidates beyond the threshold, the most surprising first."""
        return sorted(
            (n for n in self.evidence if self.surprise(n) > self.threshold),
            key=lambda n: -self.surprise(n),
        )

    @property
    def on_grid(self) -> bool:
        """Whether something stands out on the grid, or a constant strains beyond belief."""
        outstanding = self.largest[1] > self.threshold and self.open > self.asked
        return outstanding or self.strain > TUNING.screen.beyond

    @property
    def alarmed(self) -> bool:
        """Whether something stands out on the grid, or a ripple at the recordings' own rate."""
        return self.on_grid or self.ripple < TUNING.screen.line


def tail_quantile(values: Array, level: float) -> float:
    """What values (n,) exceed with probability `level`: exponential tail beyond the 90 % quantile
    (Davison, Smith 1990).
    """
    start = float(np.quantile(values, 1.0 - TUNING.screen.tail))
    beyond = values[values > start] - start
    return (
        start + float(beyond.mean()) * np.log(TUNING.screen.tail / level) if beyond.size else start
    )


def tail_chance(values: Array, value: float) -> float:
    """Chance of a value among nulls (n,): counted; where fewer than ten reach it by the tail of
    `tail_quantile`, which is not trusted beyond a tenth of what can be counted.
    """
    least = 1.0 / (1 + values.size)
    counted = float(1 + np.sum(values >= value)) * least

    start = float(np.quantile(values, 1.0 - TUNING.screen.tail))
    beyond = values[values > start] - start

    if counted > TUNING.screen.counted * least or not beyond.size:
        return counted
    fitted = TUNING.screen.tail * float(np.exp(-(value - start) / max(float(beyond.mean()), SIZE)))
    return min(counted, max(fitted, TUNING.screen.trusted_tail * least))


def whitened(noise: Noise, signatures: Iterable[Signature]) -> Iterator[WhitenedSignature]:
    """Each in its turn, some whitened at a time."""
    for some in some_of(signatures):
        columns = whiten(noise, np.column_stack([s.columns for s in some]))
        ends = np.cumsum([len(s.sign) for s in some])
        for s, end in zip(some, ends, strict=True):
            yield WhitenedSignature(s, columns[:, end - len(s.sign) : end].copy())


@dataclass(frozen=True)
class Weighed:
    """What is kept of a signature: its log Bayes factor (1 + draws,), the recordings' first; its
    other parameters; its log share among all that were tried of the same candidate.
    """

    evidence: Array
    fixed: dict[str, float]
    prior: float

    @property
    def recorded(self) -> float:
        return float(self.evidence[0])


Part = Callable[[], Iterable[WhitenedSignature]]


def screen_signatures(
    projection: Projection,
    parts: Sequence[Part],
    searched: Mapping[Shape, Array] | None = None,
    jobs: int = 1,
    kept: Sequence[object] = (),
) -> Screen:
    """Evidence of each candidate (averaged over its signatures) and its largest in every surrogate.

    parts: give the signatures, all of one candidate in the same part; searched: shapes that were
    tried elsewhere (scans.py), with their averages (1 + draws,); jobs: processes; kept: large
    objects that the signatures hold (parallel.py).
    """
    made = each(jobs, lambda part: _weighed_part(projection, part()), parts, kept)
    weighed = {of: every for part, _ in made for of, every in part.items()}
    if not weighed:
        return Screen({"none": 0.0}, {"none": (0.0, 1.0)}, {}, {}, np.zeros(2), {"none": 1.0})
    return _ranked(weighed, {of: s for _, best in made for of, s in best.items()}, searched or {})


def _weighed_part(
    projection: Projection, signatures: Iterable[WhitenedSignature]
) -> tuple[dict[Candidate, list[Weighed]], dict[Candidate, Signature]]:
    """What is kept of every signature, and the likeliest of each candidate."""
    weighed: dict[Candidate, list[Weighed]] = {}
    best: dict[Candidate, tuple[float, Signature]] = {}
    for some in some_of(signatures):
        for s, evidence in zip(some, _evidence(projection, some), strict=True):
            of, value = s.signature.of, float(evidence[0])
            weighed.setdefault(of, []).append(
                Weighed(evidence, s.signature.fixed, s.signature.prior)
            )
            if of not in best or value > best[of][0]:
                best[of] = value, s.signature
    return weighed, {of: s for of, (_, s) in best.items()}


def _evidence(projection: Projection, some: Sequence[WhitenedSignature]) -> Iterator[Array]:
    """Log Bayes factor (1 + draws,) of every signature."""
    projected = projection.project_all(np.column_stack([s.columns for s in some]))
    ends = np.cumsum([s.columns.shape[1] for s in some])
    for s, end in zip(some, ends, strict=True):
        own = slice(end - s.columns.shape[1], end)
        yield log_evidence(projected.a[own, own], projected.b[own], s.signature.sign)


def _ranked(
    weighed: Mapping[Candidate, Sequence[Weighed]],
    best: dict[Candidate, Signature],
    searched: Mapping[Shape, Array],
) -> Screen:
    """From every signature that was weighed, and the likeliest of each candidate."""
    fixed: dict[Candidate, list[dict[str, float]]] = {}
    means: dict[Candidate, Array] = {shape: mean for shape, mean in searched.items()}
    for candidate, every in weighed.items():
        tried = sorted(every, key=lambda one: -one.recorded)
        fixed[candidate] = [one.fixed for one in tried]
        prior = np.array([one.prior for one in tried])[:, None]
        means[candidate] = log_sum(np.stack([one.evidence for one in tried]) + prior)

    usual = {of: _usual(mean[1:]) for of, mean in means.items()}
    surprises = [(mean[1:] - usual[of][0]) / usual[of][1] for of, mean in means.items()]
    chance = {of: tail_chance(mean[1:], float(mean[0])) for of, mean in means.items()}
    return Screen(
        {of: float(mean[0]) for of, mean in means.items()},
        usual,
        best,
        fixed,
        np.max(surprises, axis=0),
        chance,
    )


def _usual(nulls: Array) -> tuple[float, float]:
    """Where the last tenth of nulls begins (0 at least), and their mean reach beyond (1 nat at
    least).
    """
    start = max(float(np.quantile(nulls, 1.0 - TUNING.screen.tail)), 0.0)
    beyond = nulls[nulls > start] - start
    return start, max(float(beyond.mean()) if beyond.size else 0.0, 1.0)
