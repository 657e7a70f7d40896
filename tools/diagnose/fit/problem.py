"""Constants and effects fitted together to all channels of all runs: Gauss-Newton with priors,
started warm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.effects.base import Effect, Parameter
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_bayes
from gritd.tools.diagnose.fit.projection import Projection, Surrogates
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Stack

Maker = Callable[..., Effect]  # an effect's class, or one with some parameters given

STEP = 0.02  # of a prior σ or an expected size, for differences
ROUNDS = 8
ENOUGH = 0.02  # [nats] an improvement less than this ends the descent
WIDE = 3.0  # a strength's prior standard deviation, in units of the expected size


@dataclass(frozen=True)
class FreeParameter:
    """One parameter of an effect in the fit: its value is off + x · size, inside its bounds."""

    effect: Maker
    parameter: Parameter
    name: str  # of the effect

    def value(self, x: float) -> float:
        p = self.parameter
        return float(np.clip(p.centre + x * p.sigma, p.low, p.high))

    @property
    def weight(self) -> float:
        """Square root of the prior precision of x."""
        return 1.0 / WIDE if self.parameter.role == "strength" else 1.0


@dataclass(frozen=True)
class Fitted:
    """A maximum of the posterior. x: constants in prior σ, then effect parameters in expected
    sizes, then tolerance.
    """

    effects: tuple[Maker, ...]
    free: tuple[FreeParameter, ...]
    u: Array  # (q,)
    x: Array  # (p,)
    predicted: Array  # (N,), tolerance not included
    residual: Array  # (N,) whitened, tolerance not included
    jacobian: Array  # (N, q + p + tolerance) whitened
    raw: Array  # (N, q + p) the same in the channels' units
    penalty: Array  # (q + p + tolerance,) square root of the prior precision
    slack: Array  # fitted tolerance (t,)
    objective: float  # whitened squares and prior strain at the optimum

    @property
    def acting(self) -> tuple[Effect, ...]:
        return build(self.effects, self.free, self.x)

    def covariance(self) -> Array:
        """Of all unknowns (q + p + t, q + p + t), in the units of u, x and slack."""
        gram = self.jacobian.T @ self.jacobian + np.diag(self.penalty**2)
        return np.asarray(np.linalg.inv(gram))

    @cached_property
    def log_evidence(self) -> float:
        """Log evidence, up to a constant that all models of one problem share.

        Laplace's approximation (MacKay 2003, ch. 27) for all unknowns but the strengths; these have
        the screen's prior: several sizes, and of each effect all strengths or one alone.
        """
        strong = np.zeros(self.penalty.size, bool)
        strong[len(self.u) : len(self.u) + len(self.free)] = [
            f.parameter.role == "strength" for f in self.free
        ]

        centre = np.concatenate((self.u, self.x, np.zeros_like(self.slack)))
        prior = np.where(strong, 0.0, self.penalty**2)
        pull = self.jacobian.T @ self.residual - prior * centre
        gram = self.jacobian.T @ self.jacobian + np.diag(prior)

        root = np.linalg.cholesky(gram[np.ix_(~strong, ~strong)])
        inside = np.linalg.solve(
            root, np.column_stack((gram[np.ix_(~strong, strong)], pull[~strong]))
        )
        spread = 2.0 * np.log(np.diag(root)).sum() - 2.0 * np.log(self.penalty[~strong]).sum()

        misfit = (
            self.residual @ self.residual
            + np.sum(prior * centre**2)
            - inside[:, -1] @ inside[:, -1]
        )

        a = gram[np.ix_(strong, strong)] - inside[:, :-1].T @ inside[:, :-1]
        b = pull[strong] - inside[:, :-1].T @ inside[:, -1]
        return float(-0.5 * (misfit + spread) + self._strengths(a, b, centre[strong]))

    def _strengths(self, a: Array, b: Array, at: Array) -> float:
        """What the strengths add to the log evidence, from curvature (p, p) and slope (p,) of the
        likelihood there.
        """
        if not at.size:
            return 0.0
        free = [f for f in self.free if f.parameter.role == "strength"]
        sign = [int(f.parameter.low >= f.parameter.off) for f in free]

        names = [f.name for f in free]
        groups = [[i for i, n in enumerate(names) if n == name] for name in dict.fromkeys(names)]
        chosen = [
            sorted(i for part in parts for i in part) for parts in product(*map(_choices, groups))
        ]

        pull = b + a @ at  # seen from strengths of nought
        evidence = [log_bayes(a[np.ix_(s, s)], pull[s], tuple(sign[i] for i in s)) for s in chosen]
        return float(logsumexp(evidence) - np.log(len(evidence)) - b @ at - 0.5 * at @ a @ at)

    def projection(self, surrogates: Surrogates | None = None) -> Projection:
        """The neighbourhood of this fit, for signatures of further effects."""
        scaled = self.jacobian / self.penalty
        centre = np.concatenate((self.u, self.x, np.zeros_like(self.slack)))
        return Projection(scaled, self.residual, centre * self.penalty, surrogates)


def _choices(strengths: list[int]) -> list[list[int]]:
    """All strengths of an effect together, and each alone."""
    return [strengths] if len(strengths) == 1 else [strengths, *([i] for i in strengths)]


def build(effects: Sequence[Maker], free: Sequence[FreeParameter], x: Array) -> tuple[Effect, ...]:
    """The effects with their free parameters at x (p,)."""
    values: list[dict[str, float]] = [{} for _ in effects]
    for f, value in zip(free, x.tolist(), strict=True):
        values[effects.index(f.effect)][f.parameter.name] = f.value(value)
    return tuple(effect(**v) for effect, v in zip(effects, values, strict=True))


class Problem:
    """The recordings, their noise and the tolerance, for any set of effects."""

    def __init__(self, stack: Stack, noise: Noise, tolerance: Array) -> None:
        """tolerance: (N, t) smooth columns, each one standard deviation of what the model may be
        off by.
        """
        self.stack, self.noise, self.allowed = stack, noise, tolerance
        self.tolerance = whiten(noise, tolerance) if tolerance.size else np.zeros((stack.size, 0))
        self.measured = whiten(noise, stack.measured)

    def beside(self, columns: Array) -> Problem:
        """The same with more columns (N, m), each one standard deviation, that no effect stands
        for.
        """
        other = copy(self)
        other.tolerance = np.column_stack((self.tolerance, whiten(self.noise, columns)))
        other.allowed = np.column_stack((self.allowed, columns))
        return other

    def descend(
        self,
        effects: Sequence[Maker],
        free: Sequence[FreeParameter],
        u: Array,
        x: Array,
        rounds: int = ROUNDS,
    ) -> Fitted:
        """The nearest optimum from constants u (q,) and effect parameters x (p,)."""
        q = len(u)
        penalty = np.concatenate(
            (np.ones(q), [f.weight for f in free], np.ones(self.tolerance.shape[1]))
        )
        centre = np.concatenate((u, x))
        state = self._at(effects, free, centre, q)
        return self.refine(self._state(effects, free, centre, q, state, penalty), rounds)

    def refine(self, best: Fitted, rounds: int = ROUNDS) -> Fitted:
        """The nearest optimum from a fit that was not finished."""
        for _ in range(rounds):
            better = self._search(
                best.effects, best.free, best, self._step(best), len(best.u), best.penalty
            )
            if better is None:
                break
            gained, best = best.objective - better.objective, better
            if gained < ENOUGH:
                break
        return best

    def _search(
        self,
        effects: Sequence[Maker],
        free: Sequence[FreeParameter],
        best: Fitted,
        step: Array,
        q: int,
        penalty: Array,
    ) -> Fitted | None:
        """The first shortened step that improves, with its Jacobian."""
        centre = np.concatenate((best.u, best.x))
        for share in (1.0, 0.4, 0.1):
            tried = self._bounded(free, centre + share * step, q)
            predicted, residual = self._at(effects, free, tried, q)
            _, objective = self._slack(residual, tried, penalty)
            if objective < best.objective:
                return self._state(effects, free, tried, q, (predicted, residual), penalty)
        return None

    def _bounded(self, free: Sequence[FreeParameter], centre: Array, q: int) -> Array:
        out = centre.copy()
        for i, f in enumerate(free):
            p = f.parameter
            out[q + i] = np.clip(
                out[q + i], (p.low - p.centre) / p.sigma, (p.high - p.centre) / p.sigma
            )
        out[:q] = np.clip(out[:q], -8.0, 8.0)
        return out

    def _at(
        self, effects: Sequence[Maker], free: Sequence[FreeParameter], centre: Array, q: int
    ) -> tuple[Array, Array]:
        predicted = self.stack.predict(centre[:q], build(effects, free, centre[q:]))
        return predicted, self.measured - whiten(self.noise, predicted)

    def _slack(self, residual: Array, centre: Array, penalty: Array) -> tuple[Array, float]:
        """Best tolerance for a residual, and the objective with it."""
        t = self.tolerance
        gram = t.T @ t + np.eye(t.shape[1])
        slack = np.asarray(np.linalg.solve(gram, t.T @ residual)) if t.shape[1] else np.zeros(0)
        left = residual - t @ slack
        return slack, float(
            left @ left + slack @ slack + np.sum((penalty[: len(centre)] * centre) ** 2)
        )

    def _state(
        self,
        effects: Sequence[Maker],
        free: Sequence[FreeParameter],
        centre: Array,
        q: int,
        at: tuple[Array, Array],
        penalty: Array,
    ) -> Fitted:
        predicted, residual = at
        slack, objective = self._slack(residual, centre, penalty)
        raw = np.empty((self.stack.size, len(centre)))
        partial = self.stack.partial
        for i in (i for i in range(len(centre)) if i not in partial):
            raw[:, i] = self._difference(effects, free, centre, q, i, predicted)
        for i, (whole, share) in partial.items():
            raw[:, i] = share * raw[:, whole]

        jacobian = whiten(self.noise, raw)
        return Fitted(
            tuple(effects), tuple(free), centre[:q], centre[q:], predicted, residual,
            np.column_stack((jacobian, self.tolerance)), raw, penalty, slack, objective,
        )  # fmt: skip

    def _difference(
        self,
        effects: Sequence[Maker],
        free: Sequence[FreeParameter],
        centre: Array,
        q: int,
        i: int,
        predicted: Array,
    ) -> Array:
        """Derivative of the prediction by one unknown; away from a bound."""
        step = STEP
        if i >= q:
            p = free[i - q].parameter
            step = -STEP if centre[i] * p.sigma + p.centre + STEP * p.sigma > p.high else STEP

        moved = centre.copy()
        moved[i] += step
        change: Array = (
            self.stack.predict(moved[:q], build(effects, free, moved[q:])) - predicted
        ) / step
        return change

    def _step(self, fitted: Fitted) -> Array:
        count = len(fitted.u) + len(fitted.x)
        j, penalty = fitted.jacobian, fitted.penalty
        pulled = np.concatenate((fitted.u, fitted.x, np.zeros_like(fitted.slack)))
        step = np.linalg.solve(
            j.T @ j + np.diag(penalty**2), j.T @ fitted.residual - penalty**2 * pulled
        )
        return np.asarray(step[:count])


def free_of(effects: Sequence[type[Effect]]) -> tuple[FreeParameter, ...]:
    return tuple(FreeParameter(e, p, e.name) for e in effects for p in e.parameters())
