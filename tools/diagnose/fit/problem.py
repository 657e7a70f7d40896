"""Constants and effects fitted together to all channels of all runs, within their priors and
bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from gritd.estimator.effects.base import Effect, Parameter
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit import descent
from gritd.tools.diagnose.fit.freedom import Freedom
from gritd.tools.diagnose.fit.projection import Projection, Surrogates
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Bools, Constant, Stack
from gritd.tools.diagnose.tuning import TUNING

Maker = Callable[..., Effect]  # an effect's class, or one with some parameters given


@dataclass(frozen=True)
class Free:
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
        return 1.0 / TUNING.fit.strength_prior if self.parameter.role == "strength" else 1.0


@dataclass(frozen=True)
class Fitted:
    """An optimum of the posterior. x: constants in prior σ, then effect parameters in expected
    sizes, then tolerance.
    """

    effects: tuple[Maker, ...]
    free: tuple[Free, ...]
    u: Array  # (q,)
    x: Array  # (p,)
    predicted: Array  # (N,), tolerance not included
    residual: Array  # (N,) whitened, tolerance not included
    jacobian: Array  # (N, q + p + tolerance) whitened
    raw: Array  # (N, q + p) the same in the channels' units
    penalty: Array  # (q + p + tolerance,) square root of the prior precision
    slack: Array  # fitted tolerance (t,)
    objective: float  # whitened squares and prior strain at the optimum
    carried: (
        Array  # (N, m) in the channels' units: the last of the tolerance, predicted elsewhere too
    )
    held: Bools  # (q + p,) stands at its bound and wants out
    root: Array  # (t, t) Cholesky root of the tolerance's products and its prior
    converged: bool = False

    @property
    def acting(self) -> tuple[Effect, ...]:
        return build(self.effects, self.free, self.x)

    @property
    def centre(self) -> Array:
        """Constants and effect parameters (q + p,)."""
        return np.concatenate((self.u, self.x))

    @property
    def all_u(self) -> Array:
        return np.concatenate((self.u, self.x, self.slack))

    @property
    def nats(self) -> float:
        return 0.5 * self.objective

    @cached_property
    def gradient(self) -> Array:
        """Of `nats` by constants and effect parameters (q + p,), the tolerance fitted to each."""
        own = self.jacobian[:, : self.raw.shape[1]]
        left = self.residual - self.jacobian[:, own.shape[1] :] @ self.slack
        return np.asarray(self.penalty[: own.shape[1]] ** 2 * self.centre - own.T @ left)

    @cached_property
    def curvature(self) -> Array:
        """Of `nats` (q + p, q + p), the tolerance fitted to each."""
        count = self.raw.shape[1]
        own, tolerance = self.jacobian[:, :count], self.jacobian[:, count:]
        inside = solve_triangular(self.root, tolerance.T @ own, lower=True, check_finite=False)
        taken = inside.T @ inside
        return np.asarray(own.T @ own - taken + np.diag(self.penalty[:count] ** 2))

    def covariance(self) -> Array:
        gram = self.jacobian.T @ self.jacobian + np.diag(self.penalty**2)
        return np.asarray(np.linalg.inv(gram))

    def projection(self, surrogates: Surrogates | None = None) -> Projection:
        """The neighbourhood of this fit, for signatures of further effects."""
        scaled = self.jacobian / self.penalty
        centre = np.concatenate((self.centre, np.zeros_like(self.slack)))
        return Projection(scaled, self.residual, centre * self.penalty, surrogates)


def build(effects: Sequence[Maker], free: Sequence[Free], x: Array) -> tuple[Effect, ...]:
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
        self.carried = np.zeros((stack.size, 0))
        self.measured = whiten(noise, stack.measured)

    @cached_property
    def root(self) -> Array:
        """Cholesky root (t, t) of the tolerance's products and its unit prior."""
        gram = self.tolerance.T @ self.tolerance
        gram[np.diag_indices_from(gram)] += 1.0
        return np.asarray(cholesky(gram, lower=True, overwrite_a=True, check_finite=False))

    def beside(self, columns: Array) -> Problem:
        """The same with more columns (N, m), each one standard deviation, that no effect stands
        for.
        """
        return self._with(columns, whiten(self.noise, columns))

    def with_freedoms(self, freedoms: Sequence[Freedom], sizes: Sequence[float]) -> Problem:
        """The same with freedoms of given sizes."""
        sized = [(f, size) for f, size in zip(freedoms, sizes, strict=True) if size > 0.0]
        if not sized:
            return self
        return self._with(
            np.column_stack([f.columns * size for f, size in sized]),
            np.column_stack([f.whitened * size for f, size in sized]),
        )

    def _with(self, columns: Array, whitened: Array) -> Problem:
        other = copy(self)
        other.__dict__.pop("root", None)
        other.tolerance = np.column_stack((self.tolerance, whitened))
        other.allowed = np.column_stack((self.allowed, columns))
        other.carried = np.column_stack((self.carried, columns))
        return other

    def descend(
        self,
        effects: Sequence[Maker],
        free: Sequence[Free],
        u: Array,
        x: Array,
        rounds: int | None = None,
    ) -> Fitted:
        """The nearest optimum within bounds from constants u and effect parameters x."""
        ground = _Ground(self, tuple(effects), tuple(free))
        start = ground.tried(ground.bounds.clipped(np.concatenate((u, x))))[0]
        here = ground.linearised(start)
        most = TUNING.fit.rounds if rounds is None else rounds
        fitted, converged = descent.descend(ground, here, most) if most else (here, False)
        return replace(fitted, converged=converged)

    def refit(self, fitted: Fitted, rounds: int | None = None) -> Fitted:
        """The nearest optimum from a fit with other tolerances, whose slopes are a start."""
        ground = _Ground(self, fitted.effects, fitted.free)
        start = ground.tried(fitted.centre)[0]
        most = TUNING.fit.rounds if rounds is None else rounds
        found, converged = descent.descend(ground, ground.moved(fitted, start), most)
        return replace(found, converged=converged)


@dataclass(frozen=True)
class _Tried:
    """A prediction that was not linearised."""

    centre: Array
    predicted: Array
    residual: Array
    slack: Array
    objective: float


class _Ground:
    """What is descended for one set of effects: see descent.Ground."""

    def __init__(
        self, problem: Problem, effects: tuple[Maker, ...], free: tuple[Free, ...]
    ) -> None:
        self._problem, self._effects, self._free = problem, effects, free
        constants = problem.stack.rig.constants
        self._count = len(constants)
        weights = (np.ones(self._count), [f.weight for f in free])
        self._penalty = np.concatenate((*weights, np.ones(problem.tolerance.shape[1])))

        ends = [_ends(known) for known in constants] + [_ends_of(f) for f in free]
        low, high = np.array(ends).reshape(-1, 2).T
        self.bounds = descent.Bounds(low, high)

    def tried(self, centre: Array) -> tuple[_Tried, float]:
        problem = self._problem
        predicted = self._predicted(centre)
        if not np.isfinite(predicted).all():
            return _Tried(centre, predicted, predicted, np.zeros(0), np.inf), np.inf
        residual = problem.measured - whiten(problem.noise, predicted)

        tolerance = problem.tolerance
        slack = cho_solve((problem.root, True), tolerance.T @ residual, check_finite=False)
        left = residual - tolerance @ slack
        strain = np.sum((self._penalty[: centre.size] * centre) ** 2)
        objective = float(left @ left + slack @ slack + strain)
        return _Tried(centre, predicted, residual, slack, objective), 0.5 * objective

    def linearised(self, tried: _Tried) -> Fitted:
        raw = self._derivatives(tried.centre, tried.predicted)
        return self._fitted(tried, raw, whiten(self._problem.noise, raw))

    def moved(self, here: Fitted, tried: _Tried) -> Fitted:
        """There, with the derivatives of a fit that stands next to it."""
        return self._fitted(tried, here.raw, here.jacobian[:, : here.raw.shape[1]])

    def _fitted(self, tried: _Tried, raw: Array, whitened: Array) -> Fitted:
        problem, centre = self._problem, tried.centre
        jacobian = np.column_stack((whitened, problem.tolerance))
        fitted = Fitted(
            self._effects,
            self._free,
            centre[: self._count],
            centre[self._count :],
            tried.predicted,
            tried.residual,
            jacobian,
            raw,
            self._penalty,
            tried.slack,
            tried.objective,
            problem.carried,
            np.zeros(centre.size, bool),
            problem.root,
        )
        return replace(fitted, held=self.bounds.held(centre, fitted.gradient))

    def _predicted(self, centre: Array) -> Array:
        acting = build(self._effects, self._free, centre[self._count :])
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            return self._problem.stack.predict(centre[: self._count], acting)

    def _derivatives(self, centre: Array, predicted: Array) -> Array:
        """Of the prediction by every unknown (N, q + p); away from a bound."""
        stack, raw = self._problem.stack, np.zeros((predicted.size, centre.size))
        for i in (i for i in range(centre.size) if i not in stack.partial):
            step = (
                -TUNING.fit.step
                if centre[i] + TUNING.fit.step > self.bounds.high[i]
                else TUNING.fit.step
            )
            moved = centre.copy()
            moved[i] += step
            raw[:, i] = (self._predicted(moved) - predicted) / step
        for i, (whole, share) in stack.partial.items():
            raw[:, i] = share * raw[:, whole]
        return np.nan_to_num(raw, nan=0.0, posinf=0.0, neginf=0.0)


def _ends(known: Constant) -> tuple[float, float]:
    """Bounds of a constant, in prior σ."""
    if known.log:
        return -TUNING.fit.far, TUNING.fit.far
    low, high = ((end - known.value) / known.sigma for end in (known.low, known.high))
    return max(low, -TUNING.fit.far), min(high, TUNING.fit.far)


def _ends_of(free: Free) -> tuple[float, float]:
    """Bounds of an effect's parameter, in expected sizes."""
    p = free.parameter
    return (p.low - p.centre) / p.sigma, (p.high - p.centre) / p.sigma


def free_of(effects: Sequence[type[Effect]]) -> tuple[Free, ...]:
    return tuple(Free(e, p, e.name) for e in effects for p in e.parameters())
