"""Where the misfit lives: channel by covariate, with its share, its chance, where it starts or
stops, and a sentence.

In each channel covariates are taken up by evidence, one beside the others, so that one place of the
misfit is not told once for every covariate that varies along with it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import ndtr

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain import changes, wording
from gritd.tools.diagnose.explain.result import Location
from gritd.tools.diagnose.fit import heldout
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes
from gritd.tools.diagnose.fit.functions import size_of
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.projection import Projected, Projection
from gritd.tools.diagnose.fit.ripples import orders_shown
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.noise.colour import whiten_rows
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.scans import candidates, without_harmonics
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

STRAINED = ("scale", "offset")  # constants of a channel's calibration


@dataclass(frozen=True)
class Place:
    """A place of the misfit with the nats that it takes."""

    nats: float
    location: Location


@dataclass(frozen=True, eq=False)
class CovariateFamily:
    """Functions of a covariate in one channel, with their columns in common with all others.

    nats: gained beyond chance; p: the chance of as many.
    wave: in time or along the bed, the likeliest of all frequencies; prior: its log share.
    """

    shape: Shape
    own: Index
    nats: float
    p: float
    wave: Signature | None = None
    prior: float = 0.0


def unmoved(screening: Screening, accepted: Model) -> Model:
    """The base model held at the constants found beside the accepted effects: what it misses is
    what they do.

    Fitted for itself, the base model moves soil and calibration until they hide what they can of
    the misfit, and what is left shows where they cannot follow, not where the misfit was made. With
    a reference campaign, what both campaigns do is none of it.
    """
    fit, allowance = accepted.fitted, screening.problem.allowance
    alone = screening.problem.descend((), (), fit.u, np.zeros(0), rounds=0)
    own, whitened = accepted.discrepancy()
    if screening.problem.stack.referred:
        alone = replace(alone, predicted=alone.predicted + own, residual=alone.residual - whitened)

    held = replace(
        alone,
        u=np.zeros_like(fit.u),
        own=np.zeros_like(alone.own),
        pulled=np.zeros_like(alone.pulled),
        allowance=alone.allowance.without_size(),
        residual=alone.residual - allowance.times(fit.slack[: allowance.count]),
    )
    return Model(held)


def locate(
    screening: Screening, model: Model, predicted: Array | None = None
) -> tuple[Location, ...]:
    """Places of the misfit of a model, by share; only those that survive false-discovery control.

    predicted: (N,) against which the sentences are said; without it the model's, each value's own
        run held out.
    """
    stack = screening.problem.stack
    if predicted is None:
        predicted = heldout.held_out(model.fitted, heldout.run_folds(stack)).predicted
    residual = stack.measured - predicted

    points = changes.find_changes(screening, model)
    projection = model.fitted.projection()
    projected, families = _families(screening, model, projection, points)

    places = _smooth_places(stack, residual, projected, families, points)
    places += _strains(stack, model) + _ripples(screening, projection, projected, families)
    places.sort(key=lambda place: -place.nats)
    named: dict[tuple[str, str], Location] = {}
    for place in places:  # of those of one channel and covariate the first
        named.setdefault((place.location.channel, place.location.covariate), place.location)
    return tuple(named.values())[: TUNING.explain.places_listed]


def _smooth_places(
    stack: Stack,
    residual: Array,
    projected: Projected,
    families: list[CovariateFamily],
    points: changes.Changes,
) -> list[Place]:
    """In each channel the families that are taken up and survive."""
    q = dict(zip(families, _false_discovery(np.array([f.p for f in families])), strict=True))
    places = []
    for channel in stack.rig.channels:
        here = [f for f in families if f.shape.channel == channel]
        whole = projected.gain(_joined(here))[0]

        told: list[CovariateFamily] = []
        for family in _taken_up(projected, here):
            before, told = projected.gain(_joined(told))[0], [*told, family]
            nats = projected.gain(_joined(told))[0] - before
            share = float(np.clip(nats / max(whole, SPAN), 0.0, 1.0))
            if q[family] <= TUNING.explain.false_discovery and share >= TUNING.explain.least_share:
                chance = float(q[family])
                location = _location(stack, residual, family, here, points, share, chance)
                places.append(Place(nats, location))
    return places


def _families(
    screening: Screening, model: Model, projection: Projection, points: changes.Changes
) -> tuple[Projected, list[CovariateFamily]]:
    """All smooth functions, steps at the change points of a covariate among them; and the likeliest
    waves.

    Each about a mean of its own: what grows with slip from nothing is not told as a constant and a
        slope.
    """
    stack, waves = screening.problem.stack, _waves(screening, model, projection)
    smooth = [(s.shape, _with_steps(stack, s, points)) for s in screening.functions]
    every = [*smooth, *((w.shape.family, w.columns) for w in waves)]
    shapes, columns = [shape for shape, _ in every], [block for _, block in every]

    everything = np.ones(stack.size, bool)
    ready = whiten_rows(screening.problem.noise, np.column_stack(columns), everything)
    projected = projection.project_rows(ready, everything)

    ends = np.cumsum([0, *(c.shape[1] for c in columns)])
    spans = [np.arange(start, end) for start, end in pairwise(ends.tolist())]
    told = list(zip(shapes, spans, strict=True))
    means = {shape.channel: own for shape, own in told if shape.along == ("constant",)}
    families = []
    for shape, own in told:
        both = np.union1d(own, means[shape.channel])
        families.append(CovariateFamily(shape, both, *projected.gain(both)))

    chance = _chance_of(screening, model, [w.shape.family for w in waves])
    first = len(smooth)
    return projected, families[:first] + [
        replace(family, p=chance[family.shape], wave=wave, prior=wave.prior)
        for family, wave in zip(families[first:], waves, strict=True)
    ]


def _with_steps(stack: Stack, signature: Signature, points: changes.Changes) -> Array:
    """Columns (N, m) of a smooth function, with steps at the change points of its covariate."""
    channel, along = signature.shape.channel, signature.shape.along
    places = points.get((channel, along[0]), ()) if len(along) == 1 else ()
    more = [changes.columns(stack, channel, along[0], places)] if places else []
    return np.column_stack((signature.columns, *more))


def _waves(screening: Screening, model: Model, projection: Projection) -> list[Signature]:
    """The likeliest wave of each channel and axis, where no ripple of the wheel is as likely: at a
    steady speed, or in one run, a ripple of the wheel is a wave in time and along the bed too.
    """
    problem = screening.problem
    searched = [f for f in screening.families if f.shape.kind == "wave"]
    likeliest: dict[Shape, Signature] = {}
    for wave in candidates(searched, problem, model.fitted):
        likeliest.setdefault(wave.shape.family, wave)
    turning = {
        c: _turning(screening, projection, c) for c in {shape.channel for shape in likeliest}
    }

    kept = []
    for wave in likeliest.values():
        own = problem.stack.of(wave.shape.channel)
        ready = whiten_rows(problem.noise, wave.columns[own], own)
        alone = projection.project_rows(ready, own)
        evidence = float(log_bayes(alone.a, alone.b, (0,) * len(alone.a)))
        if evidence + wave.prior > turning[wave.shape.channel]:
            kept.append(wave)
    return kept


def _turning(screening: Screening, projection: Projection, channel: str) -> float:
    """Evidence of the likeliest ripple of the wheel in a channel."""
    stack = screening.problem.stack
    orders = orders_shown(stack, 1.0)
    if not orders.size:
        return -np.inf
    own = stack.of(channel)

    waves = _turns(stack, own, orders) * np.sqrt(2.0) * size_of(stack, channel)
    columns = np.column_stack((waves.real, waves.imag))
    left = projection.project_rows(whiten_rows(screening.problem.noise, columns, own), own)
    pairs = ([k, k + orders.size] for k in range(orders.size))
    best = max(float(log_bayes(left.a[np.ix_(k, k)], left.b[k], (0, 0))) for k in pairs)
    return best - float(np.log(orders.size))


def _turns(stack: Stack, own: Bools, orders: Array) -> Array:
    """Ripples of a channel's values while the wheel turns, cosine and sine as one complex number
    (n, orders).
    """
    moving = stack.covariate("speed")[own] > 0.0
    return np.asarray(
        np.exp(1j * np.outer(stack.covariate("wheel_angle")[own], orders)) * moving[:, None]
    )


def _location(
    stack: Stack,
    residual: Array,
    family: CovariateFamily,
    here: list[CovariateFamily],
    points: changes.Changes,
    share: float,
    q: float,
) -> Location:
    """A product of covariates is filed under the one that takes most alone."""
    channel, along = family.shape.channel, family.shape.along
    if family.wave:
        words = wording.wave(stack, residual, family.wave.shape, share)
        return Location(channel, along[0], share, family.p, q, words)

    alone = {f.shape.along: f.nats for f in here if not f.wave}
    covariate = max(along, key=lambda name: alone.get((name,), 0.0))
    places = points.get((channel, covariate), ())
    if covariate == "run" and places and not wording.shows(stack, residual, channel, places):
        places = ()
    words = wording.sentence(stack, residual, family.shape, places, share)
    first = tuple(float(np.ceil(place)) for place in places) if covariate == "run" else places
    return Location(channel, covariate, share, family.p, q, words, first)


# ---- which covariates --------------------------------------------------------------------------


def _joined(families: list[CovariateFamily]) -> Index:
    """The columns of several families, each once."""
    return np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *(f.own for f in families)]))


def _chance_of(
    screening: Screening, model: Model, searched: Collection[Shape]
) -> dict[Shape, float]:
    """Largest chance that noise alone could give of the evidence that families of waves have beside
    a model (Markov's inequality).
    """
    beside = without_harmonics(screening.problem, model.fitted)
    averages = {f.shape: f.average(beside) for f in screening.families if f.shape in searched}
    return {shape: float(np.exp(-max(mean, 0.0))) for shape, mean in averages.items()}


def _taken_up(projected: Projected, families: list[CovariateFamily]) -> list[CovariateFamily]:
    """Families of a channel by evidence, each beside those before it and the mean they all hold."""
    mean = next((f for f in families if f.shape.along == ("constant",)), None)
    taken: list[CovariateFamily] = []
    best = 0.0

    while True:
        tried = {f: _evidence(projected, [*taken, f]) for f in families if f not in taken}
        first = max(tried, key=lambda f: tried[f], default=None)
        if first is None or not _adds(tried[first], best):
            return taken
        if mean and not taken and not _adds(tried[first], tried[mean]):
            first = mean
        taken, best = [*taken, first], tried[first]


def _adds(evidence: float, before: float) -> bool:
    """Whether one more family of a channel is worth naming."""
    least = max(TUNING.explain.pays, TUNING.explain.least_share * before)
    return evidence >= before + least


def _evidence(projected: Projected, families: list[CovariateFamily]) -> float:
    if not families:
        return 0.0
    own = _joined(families)
    evidence = log_bayes(projected.a[np.ix_(own, own)], projected.b[own], (0,) * own.size)
    return float(evidence) + sum(f.prior for f in families)


def _false_discovery(p: Array) -> Array:
    """Adjusted p-values (Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57, 289-300)."""
    order = np.argsort(p)
    ranked = p[order] * len(p) / np.arange(1, len(p) + 1)
    out = np.empty_like(p)
    out[order] = np.minimum(np.minimum.accumulate(ranked[::-1])[::-1], 1.0)
    return out


# ---- ripples and strains -----------------------------------------------------------------------


def _ripples(
    screening: Screening,
    projection: Projection,
    projected: Projected,
    families: list[CovariateFamily],
) -> list[Place]:
    """The strongest order of the wheel angle in each channel beside all smooth functions. A ripple
    in any channel by noise alone is as rare as the level of the screen.
    """
    stack = screening.problem.stack
    orders = orders_shown(stack, TUNING.explain.lowest_order)
    places = []
    channels = stack.rig.channels if orders.size else ()
    for channel in channels:
        here, size = [f for f in families if f.shape.channel == channel], size_of(stack, channel)
        if size <= 0.0 or not here:
            continue
        left = _beside_smooth(screening, projection, channel, orders, here)
        nats = [_pair(left, k, k + orders.size)[0] for k in range(orders.size)]
        best = int(np.argmax(nats))

        # half of χ² of two degrees, the largest of so many (Bonferroni)
        p = min(orders.size * float(np.exp(-nats[best])), 1.0)
        whole = projected.gain(_joined(here))[0]
        share = nats[best] / max(nats[best] + whole, SPAN)
        q = min(p * len(channels), 1.0)  # any of them may ripple by noise (Bonferroni)
        if q <= TUNING.screen.level and share >= TUNING.explain.least_share:
            amplitude = size * _pair(left, best, best + orders.size)[1]
            words = wording.ripple(stack, channel, float(orders[best]), amplitude, share)
            location = Location(channel, "wheel_angle", share, p, q, words)
            places.append(Place(nats[best], location))
    return places


def _beside_smooth(
    screening: Screening,
    projection: Projection,
    channel: str,
    orders: Array,
    here: list[CovariateFamily],
) -> Projected:
    """Ripples of every order (cosines, then sines) with all other functions of the channel
    projected out.
    """
    stack = screening.problem.stack
    own, size = stack.of(channel), size_of(stack, channel)
    waves = _turns(stack, own, orders)
    smooth = [s.columns[own] for s in screening.functions if s.shape.channel == channel]
    others = np.column_stack((*smooth, *(f.wave.columns[own] for f in here if f.wave)))

    columns = np.column_stack((size * waves.real, size * waves.imag, others))
    ready = whiten_rows(screening.problem.noise, columns, own)
    beyond = slice(2 * orders.size, columns.shape[1])
    return projection.project_rows(ready, own).without_columns(beyond)


def _pair(left: Projected, one: int, two: int) -> tuple[float, float]:
    """Nats that cosine and sine of an order gain, and their amplitude in expected sizes."""
    own = [one, two]
    a = left.a[np.ix_(own, own)] + TUNING.explain.ridge * np.eye(2)
    weights = np.linalg.solve(a, left.b[own])
    return 0.5 * float(left.b[own] @ weights), float(np.linalg.norm(weights))


def _strains(stack: Stack, model: Model) -> list[Place]:
    """Calibration constants pulled far off what is known: a misfit that hides there leaves no
    residual.
    """
    nats = 0.5 * model.fitted.u**2
    places = []

    constants = zip(stack.rig.constants, model.fitted.u.tolist(), nats.tolist(), strict=True)
    for constant, u, taken in constants:
        channel, kind = constant.channel, constant.kind
        if kind in STRAINED and abs(u) > TUNING.explain.doubtful_constant:
            words = wording.strain(channel, kind, constant.of(u), constant.unit, u)
            p, share = float(2.0 * ndtr(-abs(u))), taken / float(nats.sum())
            places.append(Place(taken, Location(channel, "constant", share, p, p, words)))
    return places
