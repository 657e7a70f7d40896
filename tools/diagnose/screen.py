"""The screen: evidence of every effect and of every smooth misfit at once, against what noise alone would show.

Nulls are surrogates of the recordings' own noise (size and colour drawn from their posterior) together with constants
drawn from their priors; each goes through the same linear algebra, so the threshold is a quantile of the largest of
*all* statistics, however many were tried and however alike they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from estimator.terramechanics.soil import Array
from tools.diagnose.evidence import Base, Signature, log_evidence
from tools.diagnose.noise import Noise, surrogates, whiten

LEVEL = 0.01  # false alarms aimed at, half of what is allowed
NULLS = 300
LEAST = 2.0  # [nats] no evidence below this is an alarm, however quiet the nulls


@dataclass(frozen=True)
class Whitened:
    """A signature in units of independent noise; its columns may have been left out where they vanish."""

    signature: Signature
    columns: Array


@dataclass(frozen=True)
class Screen:
    """Log Bayes factors by name, the best shape of each, and the largest of each null."""

    evidence: dict[str, float]
    best: dict[str, Whitened]
    shapes: dict[str, list[dict[str, float]]]  # of each name, the most likely first
    nulls: Array  # (draws,) the largest of all names

    @property
    def threshold(self) -> float:
        return max(float(tail_quantile(self.nulls, LEVEL)), LEAST)

    @property
    def largest(self) -> tuple[str, float]:
        name = max(self.evidence, key=lambda n: self.evidence[n])
        return name, self.evidence[name]

    @property
    def p(self) -> float:
        return float((1 + np.sum(self.nulls >= self.largest[1])) / (1 + len(self.nulls)))

    @property
    def alarmed(self) -> bool:
        return self.largest[1] > self.threshold


def tail_quantile(values: Array, level: float) -> float:
    """The value exceeded with probability `level`: exponential tail beyond the 90 % quantile (Davison, Smith 1990)."""
    start = float(np.quantile(values, 0.9))
    beyond = values[values > start] - start
    return start + float(beyond.mean()) * np.log(0.1 / level) if beyond.size else start


def whitened(noise: Noise, signatures: Sequence[Signature]) -> list[Whitened]:
    """All columns whitened in one pass."""
    if not signatures:
        return []
    columns = whiten(noise, np.column_stack([s.columns for s in signatures]))
    ends = np.cumsum([len(s.sign) for s in signatures])
    return [Whitened(s, columns[:, end - len(s.sign) : end]) for s, end in zip(signatures, ends, strict=True)]


def noise_draws(noise: Noise, size: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Whitened surrogates (N, NULLS) and strains of the constants (size, NULLS)."""
    return whiten(noise, surrogates(noise, NULLS, rng)), rng.standard_normal((size, NULLS))


def screen(base: Base, signatures: Sequence[Whitened], draws: tuple[Array, Array]) -> Screen:
    """Evidence of each name (averaged over its shapes) and its largest in every null."""
    if not signatures:
        return Screen({"none": 0.0}, {}, {}, np.zeros(2))
    columns = np.column_stack([s.columns for s in signatures])
    a, b = base.projected(columns)
    null_b = base.scores(columns, *draws)
    ends = np.cumsum([s.columns.shape[1] for s in signatures])
    found: dict[str, list[tuple[float, Array, Whitened]]] = {}
    for s, end in zip(signatures, ends, strict=True):
        own = slice(end - s.columns.shape[1], end)
        both = np.column_stack((b[own], null_b[own]))
        value = log_evidence(a[own, own], both, s.signature.sign)
        found.setdefault(s.signature.name, []).append((float(value[0]), value[1:], s))
    evidence, best, order, nulls = {}, {}, {}, []
    for name, shapes in found.items():
        shapes.sort(key=lambda item: -item[0])
        order[name] = [s.signature.shape for _, _, s in shapes]
        evidence[name] = float(logsumexp([v for v, _, _ in shapes]) - np.log(len(shapes)))
        best[name] = shapes[0][2]
        nulls.append(logsumexp(np.stack([n for _, n, _ in shapes]), axis=0) - np.log(len(shapes)))
    return Screen(evidence, best, order, np.max(nulls, axis=0))
