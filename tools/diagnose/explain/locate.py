"""Where the misfit lives: channel by covariate, with its share, its chance, where it starts or
stops, and a sentence.

In each channel covariates are taken up by evidence, one beside the others, so that one place of the
misfit is not told once for every covariate that varies along with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import norm

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain import changes
from gritd.tools.diagnose.explain import words_of_place as where
from gritd.tools.diagnose.explain.result import Location
from gritd.tools.diagnose.explain.scores import Beside, Scores
from gritd.tools.diagnose.fit import heldout
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes
from gritd.tools.diagnose.fit.functions import size_of
from gritd.tools.diagnose.fit.signatures import highest_order
from gritd.tools.diagnose.rig.interface import Bools, Index, Stack
from gritd.tools.diagnose.screen.scans import WAVE, candidates
from gritd.tools.diagnose.screen.screen import tail_chance
from gritd.tools.diagnose.search.search import Model, Search, rescreen

DISCOVERY = 0.05  # false-discovery rate of the list
MOST = 8
RIPPLE = 0.01  # chance of the strongest order by noise alone
FAR = 3.0  # [σ]
STRAINED = {
    "scale": "constant",
    "offset": "constant",
}  # of a channel's calibration, and the covariate it stands for
LEAST = 0.05  # share below which a place is not worth naming
# [nats] that a covariate gains beside those already named, and the LEAST share of what they gain
BESIDE = 3.0

Found = tuple[float, Location]  # with the nats that it takes


@dataclass(frozen=True, eq=False)
class Family:
    """Functions of a covariate in one channel: their columns, nats beyond chance and the chance of
    as many.
    """

    channel: str
    name: str
    own: Index
    nats: float
    p: float
    wave: Signature | None = None  # in time or along the bed, the likeliest of all frequencies

    @property
    def log_share(self) -> float:
        return self.wave.prior if self.wave else 0.0


def bare(search: Search, accepted: Model) -> Model:
    """The base model held at the constants found beside the accepted effects: what it misses is
    what they do.

    Fitted for itself, the base model moves soil and calibration until they hide what they can of
    the misfit, and what is left shows where they cannot follow, not where the misfit was made.
    """
    fit = accepted.fitted
    alone = search.problem.descend((), (), fit.u, np.zeros(0), rounds=0)
    held = replace(
        alone, u=np.zeros_like(fit.u), jacobian=np.zeros_like(alone.jacobian),
        residual=alone.residual - search.problem.tolerance @ fit.slack,
    )  # fmt: skip
    return Model(held, (), 0.0)


def locate(search: Search, model: Model, predicted: Array | None = None) -> tuple[Location, ...]:
    """Places of the misfit of a model, by share; only those that survive false-discovery control.

    predicted: (N,) against which the sentences are said; without it the model's, each value's own
        run held out.
    """
    stack = search.problem.stack
    if predicted is None:
        predicted = heldout.held_out(model.fitted, heldout.run_folds(stack)).predicted
    residual = stack.measured - predicted
    points = changes.find(search, model)
    beside = Beside(search, model)
    board, families = _families(search, model, beside, points)
    q = dict(zip(families, _false_discovery(np.array([f.p for f in families])), strict=True))
    found: list[Found] = []
    for channel in stack.rig.channels:
        here = [f for f in families if f.channel == channel]
        whole = _gain(board, _joined(here))[0]
        told: list[Family] = []
        for family in _taken_up(board, here):
            before, told = _gain(board, _joined(told))[0], [*told, family]
            nats = _gain(board, _joined(told))[0] - before
            share = float(np.clip(nats / max(whole, 1e-9), 0.0, 1.0))
            if q[family] <= DISCOVERY and share >= LEAST:
                found.append(
                    (nats, _place(stack, residual, family, here, points, share, float(q[family])))
                )
    found += _strains(stack, model) + ripples(search, beside, board, families)
    found.sort(key=lambda item: -item[0])
    return tuple(
        {(place.channel, place.covariate): place for _, place in reversed(found)}.values()
    )[::-1][:MOST]


def _families(
    search: Search, model: Model, beside: Beside, points: changes.Changes
) -> tuple[Scores, list[Family]]:
    """All smooth functions, steps at the change points of a covariate among them; and the likeliest
    waves.

    Each about a mean of its own: what grows with slip from nothing is not told as a constant and a
        slope.
    """
    stack, waves = search.problem.stack, _waves(search, model, beside)
    names, columns = [s.name for s in (*search.generics, *waves)], []
    for signature in search.generics:
        channel, _, covariate = signature.name.partition("~")
        steps = points.get((channel, covariate), ())
        more = [changes.columns(stack, channel, covariate, steps)] if steps else []
        columns.append(np.column_stack((signature.columns, *more)))
    columns += [wave.columns for wave in waves]
    board = beside.scores(np.column_stack(columns), np.ones(stack.size, bool))
    ends = np.cumsum([0, *(c.shape[1] for c in columns)])
    spans = [np.arange(start, end) for start, end in pairwise(ends.tolist())]
    smooth = len(search.generics)
    always = {
        n.partition("~")[0]: own
        for n, own in zip(names, spans, strict=True)
        if n.endswith("~constant")
    }
    spans = [
        np.union1d(own, always[n.partition("~")[0]]) for n, own in zip(names, spans, strict=True)
    ]
    families = [
        _family(board, name, own) for name, own in zip(names[:smooth], spans[:smooth], strict=True)
    ]
    chance = (search.screens.get(model.names) or rescreen(search, model)).chance
    for wave, own in zip(waves, spans[smooth:], strict=True):
        families.append(replace(_family(board, wave.name, own), p=chance[wave.name], wave=wave))
    return board, families


def _waves(search: Search, model: Model, beside: Beside) -> list[Signature]:
    """The likeliest wave of each channel and axis, where no ripple of the wheel is as likely: at a
    steady speed, or in one run, a ripple of the wheel is a wave in time and along the bed too.
    """
    every = [f for f in search.scans if f.kind == WAVE]
    found: dict[str, Signature] = {}
    for wave in candidates(every, search.problem, model.fitted):
        found.setdefault(wave.name, wave)
    turning = {c: _turning(search, beside, c) for c in {name.partition("~")[0] for name in found}}
    kept = []
    for wave in found.values():
        own = search.problem.stack.of(channel := wave.name.partition("~")[0])
        alone = beside.scores(wave.columns[own], own)
        if (
            float(log_bayes(alone.a, alone.b[:, 0], (0,) * len(alone.a))) + wave.prior
            > turning[channel]
        ):
            kept.append(wave)
    return kept


def _turning(search: Search, beside: Beside, channel: str) -> float:
    """Evidence of the likeliest ripple of the wheel in a channel."""
    stack = search.problem.stack
    orders = np.arange(1.0, highest_order(stack))
    if not orders.size:
        return -np.inf
    own = stack.of(channel)
    waves = _turns(stack, own, orders) * np.sqrt(2.0) * size_of(stack, channel)
    left = beside.scores(np.column_stack((waves.real, waves.imag)), own)
    pairs = ([k, k + orders.size] for k in range(orders.size))
    return max(float(log_bayes(left.a[np.ix_(k, k)], left.b[k, 0], (0, 0))) for k in pairs) - float(
        np.log(orders.size)
    )


def _turns(stack: Stack, own: Bools, orders: Array) -> Array:
    """Ripples of a channel's values while the wheel turns, cosine and sine as one complex number
    (n, orders).
    """
    moving = stack.covariate("speed")[own] > 0.0
    return np.asarray(
        np.exp(1j * np.outer(stack.covariate("wheel_angle")[own], orders)) * moving[:, None]
    )


def _place(
    stack: Stack,
    residual: Array,
    family: Family,
    here: list[Family],
    points: changes.Changes,
    share: float,
    q: float,
) -> Location:
    """A product of covariates is filed under the one that takes most alone."""
    if family.wave:
        axis, at = family.name.partition(" ")[0], family.wave.shape["at"]
        said = where.wave(stack, residual, family.channel, axis, at, share)
        return Location(family.channel, axis, share, family.p, q, said)
    alone = {f.name: f.nats for f in here}
    covariate = max(family.name.split("·"), key=lambda n: alone.get(n, 0.0))
    places = points.get((family.channel, covariate), ())
    if covariate == "run" and places and not where.shows(stack, residual, family.channel, places):
        places = ()
    said = where.sentence(stack, residual, family.channel, family.name, places, share)
    first = tuple(float(np.ceil(place)) for place in places) if covariate == "run" else places
    return Location(family.channel, covariate, share, family.p, q, said, first)


# ---- which covariates
# ----------------------------------------------------------------------------------------------


def _family(board: Scores, name: str, own: Index) -> Family:
    channel, _, covariate = name.partition("~")
    return Family(channel, covariate, own, *_gain(board, own))


def _joined(families: list[Family]) -> Index:
    """The columns of several families, each once."""
    return np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *(f.own for f in families)]))


def _gain(board: Scores, own: Index) -> tuple[float, float]:
    """Nats gained beyond chance, and the chance of as many."""
    if not own.size:
        return 0.0, 1.0
    smooth = np.linalg.inv(board.a[np.ix_(own, own)] + np.eye(own.size))
    nats = 0.5 * np.sum(board.b[own] * (smooth @ board.b[own]), axis=0)
    value, nulls = float(nats[0]), nats[1:]
    return max(value - float(nulls.mean()), 0.0), tail_chance(nulls, value)


def _taken_up(board: Scores, families: list[Family]) -> list[Family]:
    """Families of a channel by evidence, each beside those before it."""
    taken: list[Family] = []
    best = 0.0
    while True:
        tried = {f: _evidence(board, [*taken, f]) for f in families if f not in taken}
        if not tried or tried[first := max(tried, key=lambda f: tried[f])] < best + max(
            BESIDE, LEAST * best
        ):
            return taken
        taken, best = [*taken, first], tried[first]


def _evidence(board: Scores, families: list[Family]) -> float:
    if not families:
        return 0.0
    own = _joined(families)
    found = log_bayes(board.a[np.ix_(own, own)], board.b[own, 0], (0,) * own.size)
    return float(found) + sum(f.log_share for f in families)


def _false_discovery(p: Array) -> Array:
    """Adjusted p-values (Benjamini and Hochberg 1995, J. R. Stat. Soc. B 57, 289-300)."""
    order = np.argsort(p)
    ranked = p[order] * len(p) / np.arange(1, len(p) + 1)
    out = np.empty_like(p)
    out[order] = np.minimum(np.minimum.accumulate(ranked[::-1])[::-1], 1.0)
    return out


# ---- ripples and strains
# -------------------------------------------------------------------------------------------


def ripples(search: Search, beside: Beside, board: Scores, families: list[Family]) -> list[Found]:
    """The strongest order of the wheel angle in each channel beside all smooth functions, against
    every surrogate's.
    """
    stack = search.problem.stack
    orders = np.arange(3.0, highest_order(stack))
    found: list[Found] = []
    for channel in stack.rig.channels if orders.size else ():
        own, here = stack.of(channel), [f for f in families if f.channel == channel]
        waves, size = _turns(stack, own, orders), size_of(stack, channel)
        if size <= 0.0 or not here:
            continue
        smooth = [s.columns[own] for s in search.generics if s.name.startswith(f"{channel}~")]
        others = np.column_stack((*smooth, *(f.wave.columns[own] for f in here if f.wave)))
        columns = np.column_stack((size * waves.real, size * waves.imag, others))
        left = beside.scores(columns, own).without_columns(slice(2 * orders.size, columns.shape[1]))
        nats = np.stack([_pair(left, k, k + orders.size) for k in range(orders.size)])
        best = int(np.argmax(nats[:, 0]))
        p = tail_chance(nats[:, 1:].max(axis=0), float(nats[best, 0]))
        whole = _gain(board, _joined(here))[0]
        share = float(nats[best, 0] / max(nats[best, 0] + whole, 1e-9))
        if p <= RIPPLE and share >= LEAST:
            amplitude = size * _amplitude(left, best, best + orders.size)
            said = where.ripple(stack, channel, float(orders[best]), amplitude, share)
            found.append(
                (float(nats[best, 0]), Location(channel, "wheel_angle", share, p, p, said))
            )
    return found


def _pair(left: Scores, one: int, two: int) -> Array:
    """Nats (1 + draws,) that cosine and sine of an order gain."""
    own = [one, two]
    gained = np.linalg.solve(left.a[np.ix_(own, own)] + 1e-9 * np.eye(2), left.b[own])
    return np.asarray(0.5 * np.sum(left.b[own] * gained, axis=0))


def _amplitude(left: Scores, one: int, two: int) -> float:
    own = [one, two]
    return float(
        np.linalg.norm(np.linalg.solve(left.a[np.ix_(own, own)] + 1e-9 * np.eye(2), left.b[own, 0]))
    )


def _strains(stack: Stack, model: Model) -> list[Found]:
    """Calibration constants pulled far off what is known: a misfit that hides there leaves no
    residual.
    """
    nats = 0.5 * model.fitted.u**2
    found: list[Found] = []
    for known, u, value in zip(
        stack.rig.constants, model.fitted.u.tolist(), nats.tolist(), strict=True
    ):
        channel, _, what = known.name.rpartition("_")
        if channel in stack.rig.channels and what in STRAINED and abs(u) > FAR:
            said = where.strain(channel, what, known.of(u), known.unit, u)
            p = float(2.0 * norm.sf(abs(u)))
            found.append(
                (value, Location(channel, STRAINED[what], value / float(nats.sum()), p, p, said))
            )
    return found
