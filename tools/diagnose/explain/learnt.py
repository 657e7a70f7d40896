"""δ as a configuration holds it (estimator/model/learnt.py), from the posterior of a fitted model.

What is written is all that the recordings show beyond the equations and the accepted effects at the
configured calibration: the discrepancy of form, how far the form of an effect differs from the
library's (of one that the reference shows too), and what the fit moved calibration constants by (a
torque constant that is 1 % off looks like a δ of 1 %). Few directions hold most of what stays
uncertain of it, in all channels together; the rest is one number a channel. The mean of δ is what
the fit has, all its terms counted, less what the equations say with the soil and the effects that
are written: a soil that is an average over several explanations, say. So their sum, which the
recordings show, stays what it is.

Not written: what goes with the wheel's angle, whose zero no recording keeps, and the discrepancy of
a drive whose both sides are measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from gritd.estimator.model.correction import LEFT_OUT, root_of
from gritd.estimator.model.discrepancy import Usual, covariance, features_of
from gritd.estimator.model.learnt import CHANNELS, ChannelForm, Domain, LearntForm, LearntSoil
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import magnitude
from gritd.tools.diagnose.explain.result import Quantity
from gritd.tools.diagnose.explain.soil import linear
from gritd.tools.diagnose.fit.discrepancy import conditions_at, joined
from gritd.tools.diagnose.fit.model import Model, with_forms_had
from gritd.tools.diagnose.fit.problem import Problem, build
from gritd.tools.diagnose.rig.interface import HAD, Bools, FormSource, Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import RIDGE, SPAN

WHEN = ("delay", "blur")  # kinds of constants that move a channel in time


@dataclass(frozen=True)
class _Source:
    """One channel's δ where it acts, in sizes: its mean (n,), features (n, m), and as a linear map
    (n, w) of the unknowns.
    """

    mean: Array
    features: Array
    map: Array
    size: float
    usual: float  # root mean square of the channel, in its unit


def learnt_form(problem: Problem, model: Model, soil: Mapping[str, Quantity]) -> LearntForm | None:
    """δ of a model, for a soil that is written beside it; None for a rig or model without one."""
    stack = problem.stack
    sources = [s for s in stack.rig.forms if s.name in CHANNELS]
    usual = sources[0].usual if sources else None
    if model.marginal is None or usual is None:
        return None

    model = with_forms_had(problem, model)
    unknowns = _Unknowns(problem, model, sources)
    points = np.round(_points(stack, sources), TUNING.explain.learnt_places - 2)
    beyond = _beyond(problem, model, unknowns, _as_written(stack.rig, model, soil))
    if not np.isfinite(beyond).all():  # what is written runs away
        return None
    parts = {s.name: _source(problem, model, s, points, unknowns, beyond) for s in sources}
    return _Reduced(unknowns, parts, points).form(_domain(stack, sources), usual)


class _Unknowns:
    """Mean (w,) and covariance (w, w) of constants, effect parameters and weights of the forms."""

    def __init__(self, problem: Problem, model: Model, sources: list[FormSource]) -> None:
        rig, marginal, fitted = problem.stack.rig, model.marginal, model.fitted
        assert marginal is not None
        names = [f.name for f in marginal.terms]
        self.numbers = {s.name: names.index(s.name) for s in sources}
        # what the configuration left open of an earlier δ stands last in the tolerance
        self.held = problem.stack.doubts
        last = marginal.last_of_tolerance(self.held.shape[1])
        freedoms = [marginal.place_of(number) for number in range(len(names))]
        parts = [np.arange(len(fitted.centre)), *freedoms, last]
        ends = np.cumsum([len(part) for part in parts]).tolist()
        *self.places, self.place_of_held = (slice(*pair) for pair in pairwise(ends))
        self.mean, self.spread = marginal.moments(model.chosen, np.concatenate(parts))

        count = len(fitted.u)
        constants = [k for k in rig.constants if k.soil]
        self.soil_names = [k.name for k in constants]
        self.soil = np.zeros((len(constants), len(self.mean)))
        self.soil[:, :count] = [linear(rig, k, self.mean[:count])[1] for k in constants]
        own = self.soil @ self.spread @ self.soil.T
        sigma, self.among = _parted(own)
        # correlation, times its own σ, of every unknown with the soil
        self.beside = self.spread @ self.soil.T / sigma


def _parted(covariance: Array) -> tuple[Array, Array]:
    """Standard deviations (n,) and correlations (n, n). What stands at its bound varies with
    nothing: it counts as one of its unit, correlated with itself alone.
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    sigma = np.where(sigma > 0.0, sigma, 1.0)
    correlation = covariance / np.outer(sigma, sigma)
    np.fill_diagonal(correlation, 1.0)
    return sigma, np.asarray(correlation)


def _as_written(rig: Rig, model: Model, soil: Mapping[str, Quantity]) -> Array:
    """Constants (q,) of a configuration with a soil: calibration as it was, all else as fitted."""
    u = model.fitted.u.copy()
    u[_calibration(rig)] = 0.0
    change = {k.changes: k.of(x) for k, x in zip(rig.constants, u.tolist(), strict=True)}
    for number, constant in enumerate(rig.constants):
        if constant.soil:  # as it is in the new campaign
            factor = float(np.exp(change.get(constant.name, 0.0)))
            u[number] = constant.strain(soil[constant.name].value / factor)
    return u


def _beyond(problem: Problem, model: Model, unknowns: _Unknowns, u: Array) -> Array:
    """What constants and effects of the fit say (N,) more than those that are written."""
    fitted = model.fitted
    effects = build(fitted.effects, fitted.free, model.parameters()[0])
    moved = unknowns.mean[: len(fitted.centre)] - fitted.centre
    return fitted.predicted + fitted.raw @ moved - problem.stack.predict(u, effects)


def _points(stack: Stack, sources: list[FormSource]) -> Array:
    every = [conditions_at(stack, s)[_acting(stack, s)] for s in sources]
    return features_of(np.vstack(every), TUNING.explain.learnt_points, LEFT_OUT).points


def _acting(stack: Stack, source: FormSource) -> Bools:
    own = np.any([stack.of(c) for c in source.channels], axis=0)
    acting: Bools = own & (joined(stack, source.weight) != 0.0)
    return acting


def _source(
    problem: Problem,
    model: Model,
    source: FormSource,
    points: Array,
    unknowns: _Unknowns,
    beyond: Array,
) -> _Source:
    stack, fitted, marginal = problem.stack, model.fitted, model.marginal
    assert marginal is not None
    number, rows = unknowns.numbers[source.name], _acting(stack, source)
    whole = np.zeros((int(rows.sum()), len(unknowns.mean)))
    for freedom, place in zip(marginal.terms, unknowns.places, strict=True):
        whole[:, place] = freedom.columns.dense[rows]
    end = unknowns.places[number].stop  # what goes with the wheel's angle stands last
    whole[:, end - 2 * len(TUNING.fit.form_harmonics) : end] = 0.0
    whole[:, unknowns.place_of_held] = unknowns.held[rows]
    mean = beyond[rows] + whole @ unknowns.mean
    calibration = _calibration(stack.rig)
    whole[:, calibration] = fitted.raw[rows][:, calibration]

    values = stack.measured[stack.of(source.channels[-1]) & rows]
    usual = float(np.sqrt(np.mean(values**2))) if source.size is None else source.size
    size = usual * max(marginal.size_of(model.chosen, number), TUNING.fit.tolerance)
    scale = joined(stack, source.weight)[rows] * size
    conditions = conditions_at(stack, source)[rows]
    root = root_of(points)
    features = solve_triangular(root, covariance(conditions, points).T, lower=True).T
    if stack.rig.held is not None:  # what the configuration held already
        mean = mean + stack.joined(stack.rig.held.means)[rows]
    return _Source(mean / scale, features, whole / scale[:, None], size, usual)


def _calibration(rig: Rig) -> list[int]:
    """Constants that stay as the configuration states them, so that δ holds what they were moved
    by. Where the motor tells the torque too, that of the axle's sensor is not the filter's.
    """
    other = "axle_torque" if {"torque", "axle_torque"} <= set(rig.channels) else None

    return [
        number
        for number, constant in enumerate(rig.constants)
        if not constant.soil
        and not constant.changes
        and constant.kind not in (*WHEN, HAD)
        and constant.channel != other
    ]


class _Reduced:
    """Weights of the features of all channels (f,): their mean, and the leading directions of their
    covariance.
    """

    def __init__(self, unknowns: _Unknowns, parts: Mapping[str, _Source], points: Array) -> None:
        self._unknowns, self._parts, self._points = unknowns, parts, points
        maps = [_fit_of(part.features) for part in parts.values()]
        self._map = np.vstack([m @ p.map for m, p in zip(maps, parts.values(), strict=True)])
        self.mean = np.concatenate([m @ p.mean for m, p in zip(maps, parts.values(), strict=True)])
        spread, shared = unknowns.spread, self._map @ unknowns.beside

        root = _root(list(parts.values()))
        values, vectors = np.linalg.eigh(root @ self._map @ spread @ self._map.T @ root.T)
        values, vectors = np.maximum(values[::-1], 0.0), vectors[:, ::-1]
        count = min(int(np.sum(values > RIDGE * values[0])), TUNING.explain.learnt_directions)
        sigmas = np.sqrt(values[:count])
        self.directions = np.linalg.solve(root, vectors[:, :count] * sigmas)  # (f, r)
        self.beside = shared.T @ root.T @ vectors[:, :count] / sigmas  # (soil, r) correlations

    def form(self, domain: Domain, usual: Usual) -> LearntForm:
        """Rounded, as it is written."""
        size = len(self._points)
        channels: dict[str, ChannelForm | None] = dict.fromkeys(CHANNELS)

        for number, (name, part) in enumerate(self._parts.items()):
            place = slice(number * size, (number + 1) * size)
            channels[name] = self._channel(part, place)

        return LearntForm(
            float(f"{usual.load:.4g}"),
            float(f"{usual.rim_speed:.4g}"),
            domain,
            tuple(tuple(row) for row in self._points.tolist()),
            **channels,
            soil=self._soil(),
        )

    def _channel(self, part: _Source, place: slice) -> ChannelForm:
        """Where the points cannot follow by more than its size, the size is that."""
        mean, spread = self.mean[place], self.directions[place].T
        left = part.mean - part.features @ mean
        whole = np.sum((part.map @ self._unknowns.spread) * part.map, axis=1)
        kept = np.sum((part.features @ spread.T) ** 2, axis=1)
        rest = float(np.sqrt(np.mean(np.maximum(whole - kept, 0.0) + left**2)))

        factor, places = max(rest, 1.0), TUNING.explain.learnt_places
        rows = np.round(spread / factor, places - 1).tolist()
        return ChannelForm(
            float(f"{factor * part.size:.4g}"),
            tuple(np.round(mean / factor, places).tolist()),
            tuple(tuple(row) for row in rows),
            round(rest / factor, places),
        )

    def _soil(self) -> LearntSoil:
        """Correlations, a little less than they are, so that they hold together once rounded; the
        values are those of the file, and are put in when it is written.
        """
        names, places = self._unknowns.soil_names, TUNING.explain.learnt_places - 1
        rows, shrunk = [names.index(n) for n in ("c", "tan_phi", "k")], 1.0 - 10.0**-places
        beside = np.round(shrunk * self.beside[rows], places)
        among = np.round(shrunk**2 * self._unknowns.among[np.ix_(rows, rows)], places)

        cohesion, tan_phi, shear_modulus = (tuple(row) for row in beside.tolist())
        three = float(among[0, 1]), float(among[0, 2]), float(among[1, 2])
        return LearntSoil(0.0, 1.0, 1.0, cohesion, tan_phi, shear_modulus, three)


def _fit_of(features: Array) -> Array:
    """Least squares (m, n) of features (n, m), a little ridged."""
    gram = features.T @ features
    gram[np.diag_indices_from(gram)] += TUNING.explain.learnt_ridge * np.trace(gram) / len(gram)
    return np.asarray(np.linalg.solve(gram, features.T))


def _root(parts: list[_Source]) -> Array:
    """R (f, f), such that |R γ|² is what weights γ of the features do to the channels, each in its
    own size, in the mean over the recordings.
    """
    blocks = []
    for part in parts:
        gram = part.features.T @ part.features / len(part.features)
        gram[np.diag_indices_from(gram)] += TUNING.explain.learnt_ridge * np.trace(gram) / len(gram)
        blocks.append(np.linalg.cholesky(gram).T * part.size / part.usual)
    return np.asarray(block_diag(*blocks))


def _domain(stack: Stack, sources: list[FormSource]) -> Domain:
    acting = np.any([_acting(stack, s) for s in sources], axis=0)
    slip, load, speed, direction = (
        stack.covariate(name)[acting] for name in ("slip", "load", "speed", "direction")
    )

    forward, backward = bool(np.any(direction > 0.0)), bool(np.any(direction < 0.0))
    return Domain(
        _ends(slip, -1.0, 1.0),  # farther no condition goes
        _ends(load),
        _ends(speed),
        "both" if forward and backward else "forward" if forward else "backward",
    )


def _ends(values: Array, least: float | None = None, most: float = np.inf) -> tuple[float, float]:
    """The range of values, a few hundredths wider, outwards to a hundredth of the larger end's
    first digit; from least, if not given what is so shown, to most.
    """
    beyond = TUNING.explain.learnt_beyond
    low, high = (float(np.quantile(values, q)) for q in (beyond, 1.0 - beyond))
    largest = max(abs(low), abs(high), SPAN)
    margin, places = TUNING.explain.beyond * largest, 2 - magnitude(largest)
    unit = 10.0**-places
    ends = (np.floor((low - margin) / unit) * unit, np.ceil((high + margin) / unit) * unit)
    first, last = np.clip(ends, unit if least is None else least, most).tolist()
    return round(first, places), round(last, places)
