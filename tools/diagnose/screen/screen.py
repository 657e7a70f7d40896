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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Base, Signature, log_evidence
from gritd.tools.diagnose.noise.colour import Noise, surrogates, whiten

LEVEL = 0.01  # false alarms aimed at, half of what is allowed
NULLS = 300
LEAST = 2.0  # no surprise below this is an alarm, however quiet the nulls
KINDS = 10  # of misfit that count as independent, of all that are tried
SURE = float(np.log(KINDS / LEVEL))  # [nats] a likelihood ratio that is chance as rarely
TENTH = 0.9  # quantile from which evidence is counted


@dataclass(frozen=True)
class Whitened:
    """A signature in units of independent noise; its columns may have been left out where they
    vanish.
    """

    signature: Signature
    columns: Array


@dataclass(frozen=True)
class Screen:
    """Log Bayes factors by name, the best shape of each, and the largest surprise of each null."""

    evidence: dict[str, float]
    usual: dict[
        str, tuple[float, float]
    ]  # of each name: where the last tenth of its nulls begins, how far they reach
    best: dict[str, Whitened]
    shapes: dict[str, list[dict[str, float]]]  # of each name, the most likely first
    nulls: Array  # (draws,) the largest surprise of all names
    chance: dict[str, float] = field(
        default_factory=dict
    )  # of as much evidence under a name by noise alone
    # [nats] the evidence that is left with the noise's colour open (open_noise.py)
    open: float = np.inf

    @property
    def threshold(self) -> float:
        """At the tail of the nulls, fitted and counted: whichever is farther, since a fitted tail
        may be too light.
        """
        counted = np.sort(self.nulls)[-max(int(LEVEL * (1 + len(self.nulls))), 1)]
        return max(float(tail_quantile(self.nulls, LEVEL)), float(counted), LEAST)

    def surprise(self, name: str, evidence: float | None = None) -> float:
        """How far evidence (that of the recordings if not given) lies beyond what noise shows under
        this name.
        """
        start, reach = self.usual[name]
        return ((self.evidence[name] if evidence is None else evidence) - start) / reach

    @property
    def largest(self) -> tuple[str, float]:
        """The most surprising name, and its surprise."""
        name = max(self.evidence, key=self.surprise)
        return name, self.surprise(name)

    @property
    def p(self) -> float:
        """Of the largest surprise, among the nulls; where it was weighed with the noise's colour
        open, no less than the chance of such a likelihood ratio in any kind of misfit (Markov's
        inequality).
        """
        counted = float((1 + np.sum(self.nulls >= self.largest[1])) / (1 + len(self.nulls)))
        return max(counted, min(KINDS * float(np.exp(-max(self.open, 0.0))), 1.0))

    @property
    def stands_out(self) -> list[str]:
        """Names beyond the threshold, the most surprising first."""
        return sorted(
            (n for n in self.evidence if self.surprise(n) > self.threshold),
            key=lambda n: -self.surprise(n),
        )

    @property
    def alarmed(self) -> bool:
        return self.largest[1] > self.threshold and self.open > SURE


def tail_quantile(values: Array, level: float) -> float:
    """The value exceeded with probability `level`: exponential tail beyond the 90 % quantile
    (Davison, Smith 1990).
    """
    start = float(np.quantile(values, 0.9))
    beyond = values[values > start] - start
    return start + float(beyond.mean()) * np.log(0.1 / level) if beyond.size else start


def tail_chance(values: Array, value: float) -> float:
    """Chance of a value among nulls: counted; where fewer than ten reach it by the tail of
    `tail_quantile`, which is not trusted beyond a tenth of what can be counted.
    """
    least = 1.0 / (1 + values.size)
    counted = float(1 + np.sum(values >= value)) * least
    start = float(np.quantile(values, 0.9))
    beyond = values[values > start] - start
    if counted > 10.0 * least or not beyond.size:
        return counted
    fitted = 0.1 * float(np.exp(-(value - start) / max(float(beyond.mean()), 1e-12)))
    return min(counted, max(fitted, 0.1 * least))


def whitened(noise: Noise, signatures: Sequence[Signature]) -> list[Whitened]:
    """All columns whitened in one pass."""
    if not signatures:
        return []
    columns = whiten(noise, np.column_stack([s.columns for s in signatures]))
    ends = np.cumsum([len(s.sign) for s in signatures])
    return [
        Whitened(s, columns[:, end - len(s.sign) : end])
        for s, end in zip(signatures, ends, strict=True)
    ]


def noise_draws(noise: Noise, size: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Whitened surrogates (N, NULLS) and strains of the constants (size, NULLS)."""
    return whiten(noise, surrogates(noise, NULLS, rng)), rng.standard_normal((size, NULLS))


def screen(
    base: Base,
    signatures: Sequence[Whitened],
    draws: tuple[Array, Array],
    searched: Mapping[str, Array] | None = None,
) -> Screen:
    """Evidence of each name (averaged over its shapes) and its largest in every null.

    searched: names whose shapes were tried elsewhere (scans.py), with the averages (1 + draws,).
    """
    if not signatures:
        return Screen({"none": 0.0}, {"none": (0.0, 1.0)}, {}, {}, np.zeros(2), {"none": 1.0})
    columns = np.column_stack([s.columns for s in signatures])
    a, b = base.projected(columns)
    null_b = base.scores(columns, *draws)
    ends = np.cumsum([s.columns.shape[1] for s in signatures])
    found: dict[str, list[tuple[Array, Whitened]]] = {}
    for s, end in zip(signatures, ends, strict=True):
        own = slice(end - s.columns.shape[1], end)
        value = log_evidence(a[own, own], np.column_stack((b[own], null_b[own])), s.signature.sign)
        found.setdefault(s.signature.name, []).append((value, s))
    return _ranked(found, searched or {})


def _ranked(
    found: dict[str, list[tuple[Array, Whitened]]], searched: Mapping[str, Array]
) -> Screen:
    """From the log Bayes factors of every shape (1 + draws,), the recordings' first."""
    best, order, means = {}, {}, dict(searched)
    for name, shapes in found.items():
        shapes.sort(key=lambda item: -item[0][0])
        order[name] = [s.signature.shape for _, s in shapes]
        best[name] = shapes[0][1]
        prior = np.array([s.signature.prior for _, s in shapes])[:, None]
        means[name] = logsumexp(np.stack([v for v, _ in shapes]) + prior, axis=0)
    usual = {name: _usual(mean[1:]) for name, mean in means.items()}
    largest = np.max(
        [(mean[1:] - usual[name][0]) / usual[name][1] for name, mean in means.items()], axis=0
    )
    chance = {name: tail_chance(mean[1:], float(mean[0])) for name, mean in means.items()}
    return Screen(
        {n: float(mean[0]) for n, mean in means.items()}, usual, best, order, largest, chance
    )


def _usual(nulls: Array) -> tuple[float, float]:
    """Where the last tenth of nulls begins (0 at least), and their mean reach beyond (1 nat at
    least).
    """
    start = max(float(np.quantile(nulls, TENTH)), 0.0)
    beyond = nulls[nulls > start] - start
    return start, max(float(beyond.mean()) if beyond.size else 0.0, 1.0)
