"""Change points: where along the bed, a run, the runs or a condition a misfit starts or stops.

A channel's misfit is taken apart by forward selection: steps and windows (the same offset between
two places) along every covariate compete with smooth functions of the same covariates, all of them
of one size or in proportion to the channel, each weighed by its log Bayes factor with a uniform
prior over its places. What drifts or curves is taken by a smooth function and gives no change
point. A step counts when its evidence, averaged over all places, is a likelihood ratio that noise
alone reaches in one of a hundred campaigns in any channel at most (Markov's inequality). Source:
binary segmentation (Scott and Knott 1974, Biometrics 30, 507-512).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_bayes, log_bayes_alone
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.projection import Projected, Projection
from gritd.tools.diagnose.noise.colour import whiten_rows
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.tuning import TUNING

ALONG = ("position", "time", "slip", "run")
# along which a misfit may curve; not tried for a start
CURVES = ("load", "speed", "sinkage", "heat", "elapsed")

Changes = dict[tuple[str, str], tuple[float, ...]]  # channel and covariate -> places in order


@dataclass(frozen=True)
class Steps:
    """Steps of one width along one covariate: column k of `own` rises from 0 to 1 at places[k]."""

    covariate: str
    places: Array
    own: slice


@dataclass(frozen=True)
class Part:
    """A step from places[0], or a window between two places; its evidence [nats]."""

    evidence: float
    steps: Steps
    places: tuple[int, ...]

    def direction(self, size: int) -> Array:
        """Its combination of the columns (size, 1)."""
        out = np.zeros((size, 1))
        for place, sign in zip(self.places, (1.0, -1.0), strict=False):
            out[self.steps.own.start + place] = sign
        return out


NONE = Part(-np.inf, Steps("", np.zeros(0), slice(0, 0)), ())


@dataclass(frozen=True)
class Competition:
    """Everything that competes for one channel's misfit."""

    channel: str
    projected: Projected
    steps: tuple[Steps, ...]
    smooth: tuple[slice, ...]


def find_changes(screening: Screening, model: Model) -> Changes:
    """Change points of every channel; empty where there are none. Of runs, halfway between their
    numbers.
    """
    projection = model.fitted.projection()
    tried = (
        _competition(screening, model, projection, channel)
        for channel in screening.problem.stack.rig.channels
    )
    competitions = [competition for competition in tried if competition is not None]
    if not competitions:
        return {}

    threshold = float(np.log(len(competitions) / TUNING.screen.level))

    changes: Changes = {}
    for competition in competitions:
        runs = _between_runs(competition, threshold)
        for part in (*runs, *_taken_apart(competition, runs, threshold)):
            key = (competition.channel, part.steps.covariate)
            places = [float(part.steps.places[i]) for i in part.places]
            changes[key] = tuple(sorted({*changes.get(key, ()), *places}))
    return changes


# ---- what competes -----------------------------------------------------------------------------


def values(stack: Stack, name: str) -> Array | None:
    """A covariate (N,); of runs, their number in order of time from 1; elapsed: time since the run
    began.
    """
    if name == "run":
        began = [float(run.time[0]) for run in stack.rig.runs]
        number = np.empty(len(began))
        number[np.argsort(began, kind="stable")] = np.arange(1, len(began) + 1)
        return np.asarray(number[stack.run])

    if name == "elapsed":
        return np.asarray(stack.time - np.array([run.time[0] for run in stack.rig.runs])[stack.run])

    return stack.covariate(name) if name in stack.rig.runs[0].covariates else None


def columns(stack: Stack, channel: str, covariate: str, places: Sequence[float]) -> Array:
    """Steps (N, m) of the channel at known change points, of the expected size of a misfit."""
    along, own = values(stack, covariate), stack.of(channel)
    assert along is not None
    moving = own & (stack.covariate("speed") > 0.0)
    size = TUNING.fit.misfit_size * float(np.sqrt(np.mean(stack.measured[own] ** 2)))
    rise = _rise(
        along, np.array(places), TUNING.explain.change_widths[0] * float(np.ptp(along[moving]))
    )
    return np.where(moving[:, None], size * rise, 0.0)


def _competition(
    screening: Screening, model: Model, projection: Projection, channel: str
) -> Competition | None:
    """None where nothing varies along which the channel could change."""
    stack = screening.problem.stack
    own = stack.of(channel)
    moving = stack.covariate("speed")[own] > 0.0
    if not moving.any():
        return None
    size = TUNING.fit.misfit_size * float(np.sqrt(np.mean(stack.measured[own] ** 2)))
    forms = [
        np.where(moving, size, 0.0)[:, None],
        np.where(moving, TUNING.fit.misfit_size * model.fitted.predicted[own], 0.0)[:, None],
    ]
    blocks = [
        (name, places, form * block)
        for name, places, block in _steps(stack, own, moving)
        for form in forms
    ]
    if not blocks:
        return None
    curves = [form * block for block in _curves(stack, own, moving) for form in forms]
    joined = [*(block for _, _, block in blocks), *curves, *_smooth(screening, channel, own)]

    ends = np.cumsum([0, *(block.shape[1] for block in joined)]).tolist()
    spans = [slice(first, last) for first, last in pairwise(ends)]
    steps = [
        Steps(name, places, span) for (name, places, _), span in zip(blocks, spans, strict=False)
    ]
    ready = whiten_rows(screening.problem.noise, np.column_stack(joined), own)
    projected = projection.project_rows(ready, own)
    return Competition(channel, projected, tuple(steps), tuple(spans[len(steps) :]))


def _along(
    stack: Stack, names: Sequence[str], own: Bools, moving: Bools
) -> Iterator[tuple[str, Array]]:
    """Covariates (n,) of a channel's values that vary while the wheel moves."""
    for name in names:
        along = values(stack, name)
        if (
            along is not None
            and np.ptp(along[own][moving]) > TUNING.fit.varies * np.abs(along[own]).max()
        ):
            yield name, along[own]


def _steps(stack: Stack, own: Bools, moving: Bools) -> Iterator[tuple[str, Array, Array]]:
    """Covariate, places, and steps there (n, places) from 0 to 1."""
    for name, along in _along(stack, ALONG, own, moving):
        if name == "run":
            places = np.arange(along.min(), along.max()) + 0.5
            yield name, places, (along[:, None] > places).astype(float)
            continue

        if _swept(along[moving]):
            low, high = np.quantile(along[moving], TUNING.explain.change_range)
            places = _distinct(
                np.linspace(low, high, TUNING.explain.change_places + 2)[1:-1], along[moving]
            )
            if name == "time":
                inside = [(r.time[0] < places) & (places < r.time[-1]) for r in stack.rig.runs]
                places = places[np.any(inside, axis=0)]

            if places.size:
                span = float(np.ptp(along[moving]))
                yield from (
                    (name, places, _rise(along, places, width * span))
                    for width in TUNING.explain.change_widths
                )


def _swept(along: Array) -> bool:
    """Whether a covariate was driven through rather than held at a few levels, between which
    nothing can be placed.
    """
    count, _ = np.histogram(along, TUNING.explain.change_places)
    return bool(
        np.sum(count >= TUNING.explain.level_held * along.size) >= TUNING.explain.swept_levels
    )


def _rise(along: Array, places: Array, width: float) -> Array:
    """(n, m) from 0 to 1 at each place."""
    return np.asarray(0.5 * (1.0 + np.tanh((along[:, None] - places) / width)))


def _distinct(places: Array, along: Array) -> Array:
    """Of several places with nothing between them the middle one."""
    beyond = np.searchsorted(np.sort(along), places, side="right")
    kept = [
        np.flatnonzero(beyond == count)
        for count in np.unique(beyond)
        if TUNING.explain.change_values <= count <= along.size - TUNING.explain.change_values
    ]
    return np.array([places[same].mean() for same in kept])


def _curves(stack: Stack, own: Bools, moving: Bools) -> Iterator[Array]:
    """Smooth functions along each covariate (n, WAVES)."""
    number = np.arange(1, TUNING.explain.change_waves + 1)
    for name, along in _along(stack, (*ALONG, *CURVES), own, moving):
        if name != "run":
            share = (along - along[moving].min()) / np.ptp(along[moving])
            yield np.cos(np.pi * number * share[:, None]) / number**2


def _smooth(screening: Screening, channel: str, own: Bools) -> Iterator[Array]:
    """The functions in which misfits without a name are looked for."""
    for signature in screening.functions:
        if signature.shape.channel == channel and signature.shape.along != ("run",):
            yield signature.columns[own]


# ---- taking it apart ---------------------------------------------------------------------------


def _weighed(of: Projected, steps: Steps) -> Iterator[tuple[Array, Sequence[tuple[int, ...]]]]:
    """Evidence (candidates,) of all steps, then of all windows, and their places."""
    a, b = of.a[steps.own, steps.own], of.b[steps.own]
    count = len(a)
    # of the choice of step or window (2), form (2), covariate and width
    price = np.log(2.0 * 2.0 * len(ALONG) * len(TUNING.explain.change_widths))

    single = log_bayes_alone(np.diag(a), b)
    yield single - np.log(count) - price, [(i,) for i in range(count)]

    if count > 1:
        i, j = np.triu_indices(count, 1)
        inside = np.diag(a)[i] + np.diag(a)[j] - 2.0 * a[i, j]
        window = log_bayes_alone(inside, b[i] - b[j])
        pairs = list(zip(i.tolist(), j.tolist(), strict=True))
        yield window - np.log(len(i)) - price, pairs


def _taken_apart(
    competition: Competition, runs: Sequence[Part], threshold: float
) -> Iterator[Part]:
    """Steps inside runs that stand beside what steps between runs and smooth functions take, the
    largest first.
    """
    left, first = competition.projected, max((part.evidence for part in runs), default=0.0)
    for part in runs:
        left = left.without(part.direction(len(left.a)))

    for _ in range(TUNING.explain.change_rounds):
        part = max(
            (_best(left, s) for s in competition.steps if s.covariate != "run"),
            key=lambda p: p.evidence,
            default=NONE,
        )
        curves = [_evidence(left, block) for block in competition.smooth]
        curve = max(curves, default=-np.inf)
        first = first or max(part.evidence, curve)
        if max(part.evidence, curve) < max(threshold, TUNING.explain.change_worth * first):
            return
        if curve >= part.evidence:
            left = left.without_columns(competition.smooth[int(np.argmax(curves))])
        else:
            left = left.without(part.direction(len(left.a)))
            yield part


def _between_runs(competition: Competition, threshold: float) -> list[Part]:
    """A few steps between runs that do nearly all that an offset of every run could: drift needs
    one at every run.
    """
    runs, whole = [s for s in competition.steps if s.covariate == "run"], competition.projected
    if not runs:
        return []
    offsets = max(_nats(whole, steps.own) for steps in runs)
    if offsets < TUNING.explain.run_share * _nats(whole, slice(0, len(whole.a))):
        return []

    left, parts = whole, list[Part]()
    while len(parts) < min(TUNING.explain.few_run_steps, len(runs[0].places) - 1):
        part = max((_best(left, steps, windows=False) for steps in runs), key=lambda p: p.evidence)
        if part.evidence < threshold:
            return []
        parts.append(part)
        taken = np.column_stack([p.direction(len(left.a)) for p in parts])
        if (
            _nats(whole.combined(taken), slice(0, len(parts)))
            >= TUNING.explain.run_nearly * offsets
        ):
            return parts
        left = left.without(part.direction(len(left.a)))
    return []


def _nats(of: Projected, own: slice) -> float:
    """Log likelihood that a block gains."""
    a, b = of.a[own, own], of.b[own]
    return float(0.5 * b @ np.linalg.solve(a + np.eye(b.size) / TUNING.fit.projected_prior**2, b))


def _evidence(left: Projected, block: slice) -> float:
    sign = (0,) * (block.stop - block.start)
    return float(log_bayes(left.a[block, block], left.b[block], sign))


def _best(left: Projected, steps: Steps, windows: bool = True) -> Part:
    parts = []
    for evidence, places in islice(_weighed(left, steps), None if windows else 1):
        at = int(np.argmax(evidence))
        parts.append(Part(float(evidence[at]), steps, places[at]))
    return max(parts, key=lambda part: part.evidence)
