"""Constants and effects fitted together to all channels of all runs, within their priors and
bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from gritd.estimator.effects.base import Effect, Parameter
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit import descent
from gritd.tools.diagnose.fit.columns import Columns, joined, whole
from gritd.tools.diagnose.fit.nuisance import NuisanceColumns
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes, random_effect
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Bools, Constant, Near
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING

Maker = Callable[..., Effect]  # an effect's class, or one with some parameters given


@dataclass(frozen=True)
class Free:
    """One parameter of an effect in the fit: its value is centre + x · sigma, inside its bounds."""

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


@dataclass(frozen=True, eq=False)
class Fitted:
    """Where a descent stands: u, constants in prior σ; x, effect parameters in expected sizes;
    slack, the weights of what is allowed.
    """

    effects: tuple[Maker, ...]
    free: tuple[Free, ...]
    u: Array  # (q,)
    x: Array  # (p,)
    predicted: Array  # (N,), what is allowed not included
    residual: Array  # (N,) whitened, what is allowed not included
    own: Array  # (N, q + p) whitened derivatives by constants and effect parameters
    raw: Array  # (N, q + p) the same in the channels' units
    penalty: Array  # (q + p + t,) square root of the prior precision
    slack: Array  # (t,) fitted weights of what is allowed
    objective: float  # whitened squares and prior strain at the optimum
    nuisance: NuisanceColumns
    pulled: Array  # (t, q + p) products of what is allowed with `own`
    gradient: Array  # (q + p,) of `nats`, what is allowed fitted to each
    curvature: Array  # (q + p, q + p) likewise
    held: Bools  # (q + p,) is at an active bound
    converged: bool = False

    @property
    def acting(self) -> tuple[Effect, ...]:
        return build(self.effects, self.free, self.x)

    @property
    def centre(self) -> Array:
        """Constants and effect parameters (q + p,)."""
        return np.concatenate((self.u, self.x))

    @property
    def nats(self) -> float:
        return 0.5 * self.objective

    @property
    def jacobian(self) -> Columns:
        """(N, q + p + t) whitened."""
        return joined(len(self.own), (whole(self.own), self.nuisance.whitened))

    @property
    def gram(self) -> Array:
        """Products (q + p + t, q + p + t) of `jacobian`."""
        own = self.own.T @ self.own
        return np.block([[own, self.pulled.T], [self.pulled, self.nuisance.gram]])

    def covariance(self) -> Array:
        """Of constants, effect parameters and what is allowed (n, n)."""
        return np.asarray(np.linalg.inv(self.gram + np.diag(self.penalty**2)))

    @cached_property
    def sigma(self) -> Array:
        """Standard deviations of the same (n,)."""
        return np.sqrt(np.diag(self.covariance()))

    def projection(self) -> Projection:
        """The neighbourhood of this fit, for signatures of further effects."""
        scaled = self.jacobian.scaled(1.0 / self.penalty)
        return Projection(scaled, self.residual, self._strain())

    def _strain(self) -> Array:
        """The fitted unknowns in prior σ (q + p + t,), of what is allowed none: the residual does
        not include it.
        """
        return np.concatenate((self.centre, np.zeros_like(self.slack))) * self.penalty


def build(effects: Sequence[Maker], free: Sequence[Free], x: Array) -> tuple[Effect, ...]:
    """Effects with their free parameters x (p,)."""
    values: list[dict[str, float]] = [{} for _ in effects]
    for f, value in zip(free, x.tolist(), strict=True):
        values[effects.index(f.effect)][f.parameter.name] = f.value(value)
    return tuple(effect(**v) for effect, v in zip(effects, values, strict=True))


class Problem:
    """The recordings, their noise and what the model may be off by, for any set of effects."""

    def __init__(self, stack: Stack, noise: Noise, tolerance: Array) -> None:
        """tolerance: (N, t) smooth columns, each one standard deviation of what the model may be
        off by.
        """
        self.stack, self.noise = stack, noise
        allowed = random_effect("tolerance", tolerance, noise, Sizes())
        self.fixed: tuple[RandomEffect, ...] = (allowed,)  # what every fit has
        self.nuisance = NuisanceColumns(((allowed, 1.0),))
        self.measured = whiten(noise, stack.measured)

    @cached_property
    def root(self) -> Array:
        """Cholesky root (t, t) of the products of what is allowed and its unit prior."""
        gram = self.nuisance.gram
        gram[np.diag_indices_from(gram)] += 1.0
        return np.asarray(cholesky(gram, lower=True, overwrite_a=True, check_finite=False))

    def in_both(self, names: Collection[str]) -> Problem:
        """The same where effects of some names act in the reference campaign too."""
        other = copy(self)
        other.stack = Stack(self.stack.rig, names)
        return other

    def with_terms(self, terms: Sequence[RandomEffect], sizes: Sequence[float]) -> Problem:
        """The same with terms of given sizes."""
        sized = [(f, size) for f, size in zip(terms, sizes, strict=True) if size > 0.0]
        return self._with(sized) if sized else self

    def _with(self, parts: Sequence[tuple[RandomEffect, float]]) -> Problem:
        other = copy(self)
        other.nuisance = self.nuisance.with_parts(parts)
        other.__dict__.pop("root", None)
        return other

    def ground(self, effects: Sequence[Maker], free: Sequence[Free]) -> EffectsObjective:
        """What is descended for a set of effects."""
        return EffectsObjective(self, tuple(effects), tuple(free))

    def descend(
        self,
        effects: Sequence[Maker],
        free: Sequence[Free],
        u: Array,
        x: Array,
        rounds: int | None = None,
        near: Fitted | None = None,
    ) -> Fitted:
        """The nearest optimum within bounds from constants u (q,) and effect parameters x (p,); the
        strengths of the last effect may be less at the start (`EffectsObjective.begun`). rounds: of
        linearisation at most; 0: it stands where it is put. near: a fit whose derivatives by the
        constants do for a beginning.
        """
        ground = self.ground(effects, free)
        if rounds == 0:  # as it stands there
            return ground.linearised(ground.tried(ground.at(u, x))[0])

        most = TUNING.numerics.rounds if rounds is None else rounds
        begun = ground.begun(u, x)
        if near is None:
            fitted, converged = descent.descend(ground, ground.linearised(begun), most)
        else:
            start = ground.followed(near, begun)
            fitted, converged = descent.descend(ground, start, most, begun)
        return replace(fitted, converged=converged)

    def refit(self, fitted: Fitted, rounds: int | None = None) -> Fitted:
        """The nearest optimum from where a fit with other terms stands, first by its slopes."""
        ground = self.ground(fitted.effects, fitted.free)
        start = ground.tried(fitted.centre)[0]
        most = TUNING.numerics.rounds if rounds is None else rounds
        reached, converged = descent.descend(ground, ground.moved(fitted, start), most)
        return replace(reached, converged=converged)


@dataclass(frozen=True)
class Tried:
    """A prediction that was not linearised."""

    centre: Array
    predicted: Array
    residual: Array
    slack: Array
    objective: float


class EffectsObjective:
    """What is descended for one set of effects: see descent.Objective.

    penalty: (q + p + t,) square root of the prior precision.
    """

    def __init__(
        self, problem: Problem, effects: tuple[Maker, ...], free: tuple[Free, ...]
    ) -> None:
        self._problem, self._effects, self._free = problem, effects, free
        constants = problem.stack.rig.constants
        self._count = len(constants)
        weights = (np.ones(self._count), [f.weight for f in free])
        self.penalty = np.concatenate((*weights, np.ones(problem.nuisance.count)))

        ends = [_ends(known) for known in constants] + [_ends_of(f) for f in free]
        low, high = np.array(ends).reshape(-1, 2).T
        self.bounds = descent.CoordinateBounds(low, high)
        shapes = [f.parameter.role != "strength" for f in free]
        self.curved = np.array([False] * self._count + shapes)

    def tried(self, centre: Array) -> tuple[Tried, float]:
        """See descent.Objective; constants, then effect parameters (n,)."""
        problem = self._problem
        predicted = self._predicted(centre)
        if not np.isfinite(predicted).all():
            nothing = np.zeros(problem.nuisance.count)
            return Tried(centre, predicted, predicted, nothing, np.inf), np.inf
        residual = problem.measured - whiten(problem.noise, predicted)

        pulled = problem.nuisance.pulled(residual)
        slack = cho_solve((problem.root, True), pulled, check_finite=False)
        strain = np.sum((self.penalty[: centre.size] * centre) ** 2)
        objective = float(residual @ residual - pulled @ slack + strain)
        return Tried(centre, predicted, residual, slack, objective), 0.5 * objective

    def begun(self, u: Array, x: Array) -> Tried:
        """Where a descent begins, from constants u (q,) and effect parameters x (p,): strengths of
        the last effect are halved while the recordings are less likely with them than without, to
        1/64 at most. In the linear algebra that foretells strengths the constants follow. At the
        start they do not, so a strong effect may stand beyond a ridge.
        """
        strong = self._strengths_of_last()
        none, most = self.tried(self.at(u, np.where(strong, 0.0, x)))
        if not np.isfinite(most):  # an effect that runs away
            none, most = self.tried(self.at(u, np.zeros_like(x)))
        if not strong.any():
            return none

        for halvings in range(TUNING.numerics.halvings):
            begun, nats = self.tried(self.at(u, np.where(strong, 0.5**halvings * x, x)))
            if nats <= most:
                return begun
        return begun if np.isfinite(nats) else none

    def _strengths_of_last(self) -> Bools:
        """Marks the strengths of the last effect among the effect parameters (p,)."""
        last = [f.effect is self._effects[-1] for f in self._free]
        strength = [f.parameter.role == "strength" for f in self._free]
        marks: Bools = np.array(last, bool) & np.array(strength, bool)
        return marks

    def at(self, u: Array, x: Array) -> Array:
        """Constants u (q,) and effect parameters x (p,) within the bounds (q + p,)."""
        return self.bounds.clipped(np.concatenate((u, x)))

    def linearised(self, tried: Tried) -> Fitted:
        problem = self._problem
        raw = self._derivatives(tried.centre, tried.predicted)
        own = whiten(problem.noise, raw)
        pulled = problem.nuisance.pulled(own)
        return self._fitted(tried, raw, own, pulled, self._curvature(own, pulled))

    def moved(self, here: Fitted, tried: Tried) -> Fitted:
        """There, with a near fit's derivatives, corrected by the way there: Broyden (1965)."""
        problem, step = self._problem, tried.centre - here.centre
        raw, own, pulled, curvature = here.raw, here.own, here.pulled, here.curvature
        if here.nuisance is not problem.nuisance:
            pulled = problem.nuisance.pulled(own)
            curvature = self._curvature(own, pulled)
        if not step.any():
            return self._fitted(tried, raw, own, pulled, curvature)

        along = step / (step @ step)
        missed = tried.predicted - here.predicted - raw @ step
        white = whiten(problem.noise, missed)
        drawn = problem.nuisance.pulled(white)
        taken = cho_solve((problem.root, True), drawn, check_finite=False)
        cross = np.outer(own.T @ white - pulled.T @ taken, along)
        square = float(white @ white - drawn @ taken)

        return self._fitted(
            tried,
            raw + np.outer(missed, along),
            own + np.outer(white, along),
            pulled + np.outer(drawn, along),
            curvature + cross + cross.T + square * np.outer(along, along),
        )

    def followed(self, here: Fitted, tried: Tried) -> Fitted:
        """There, with new derivatives by the effects' parameters; those by the constants, which
        hardly change, are those of a fit elsewhere, with any effects.
        """
        problem, first = self._problem, self._count
        more = self._derivatives(tried.centre, tried.predicted, first)
        raw = np.column_stack((here.raw[:, :first], more))
        own = np.column_stack((here.own[:, :first], whiten(problem.noise, more)))
        pulled = problem.nuisance.pulled(own)
        return self._fitted(tried, raw, own, pulled, self._curvature(own, pulled))

    def _curvature(self, own: Array, pulled: Array) -> Array:
        """(n, n) of derivatives (N, n), what is allowed fitted to each: (t, n) are its products."""
        inside = solve_triangular(self._problem.root, pulled, lower=True, check_finite=False)
        precision = self.penalty[: own.shape[1]] ** 2
        return np.asarray(own.T @ own - inside.T @ inside + np.diag(precision))

    def _fitted(
        self, tried: Tried, raw: Array, own: Array, pulled: Array, curvature: Array
    ) -> Fitted:
        problem, centre = self._problem, tried.centre
        strain = self.penalty[: centre.size] ** 2 * centre
        gradient = np.asarray(strain - own.T @ tried.residual + pulled.T @ tried.slack)
        return Fitted(
            self._effects,
            self._free,
            centre[: self._count],
            centre[self._count :],
            tried.predicted,
            tried.residual,
            own,
            raw,
            self.penalty,
            tried.slack,
            tried.objective,
            problem.nuisance,
            pulled,
            gradient,
            curvature,
            self.bounds.held(centre, gradient),
        )

    def _predicted(self, centre: Array, near: Near | None = None) -> Array:
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            return self._problem.stack.predict(*self._acting(centre), near=near)

    def _acting(self, centre: Array) -> Near:
        return centre[: self._count], build(self._effects, self._free, centre[self._count :])

    def _derivatives(self, centre: Array, predicted: Array, first: int = 0) -> Array:
        """Of the prediction by every unknown (N, q + p), or by those from one on; away from a
        bound.
        """
        stack, raw = self._problem.stack, np.zeros((predicted.size, centre.size))
        begins = self._acting(centre)

        for i in (i for i in range(first, centre.size) if i not in stack.partial):
            step = (
                -TUNING.numerics.step
                if centre[i] + TUNING.numerics.step > self.bounds.high[i]
                else TUNING.numerics.step
            )
            moved = centre.copy()
            moved[i] += step
            raw[:, i] = (self._predicted(moved, begins) - predicted) / step

        for i, (of, share) in stack.partial.items():
            raw[:, i] = share * raw[:, of]

        return np.nan_to_num(raw[:, first:], nan=0.0, posinf=0.0, neginf=0.0)


def _ends(known: Constant) -> tuple[float, float]:
    """Bounds of a constant, in prior σ, none beyond what a fit may strain it by."""
    far = TUNING.fit.far
    if known.log:
        return -far, far
    low, high = ((end - known.value) / known.sigma for end in (known.low, known.high))
    return max(low, -far), min(high, far)


def _ends_of(free: Free) -> tuple[float, float]:
    """Bounds of an effect's parameter, in expected sizes."""
    p = free.parameter
    return (p.low - p.centre) / p.sigma, (p.high - p.centre) / p.sigma


def free_of(effects: Sequence[type[Effect]]) -> tuple[Free, ...]:
    return tuple(Free(e, p, e.name) for e in effects for p in e.parameters())
