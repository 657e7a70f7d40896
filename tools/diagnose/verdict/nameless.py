"""What functions without a name would gain beside a model: smooth ones, waves and steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.screen.scans import without_harmonics
from gritd.tools.diagnose.screen.screen import whitened
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.search.search import Search

PAIR = 3.0  # [nats] a second function must gain
FORM, FORM_MOST = 0.08, 25.0  # and this share of what the first gained, at most so many nats
SIZES = (1.0, 5.0)  # of a function, in its expected size, where it is fitted
TOGETHER, FITTED = 4, 2  # functions that may act together; that are fitted with the soil


def remaining(search: Search, model: Model) -> tuple[float, bool]:
    """Nats that functions without a name would still gain; whether any of them stands out of the
    noise.
    """
    screen = search.screen_of(model)
    standing = screen.alarmed and any(isinstance(of, Shape) for of in screen.stands_out)
    return (_chosen(search.screening, model)[0] if standing else 0.0), standing


def nameless_evidence(screening: Screening, model: Model) -> float:
    """Evidence for functions without a name on top of a model [nats], as far as they may act
    together.

    Linear, and with soil and calibration fitted anew beside the first few, as they are for listed
    effects.
    """
    linear, chosen = _chosen(screening, model)
    fitted = range(min(len(chosen), FITTED))
    return max([linear, *(_refitted(screening, model, chosen[: n + 1]) for n in fitted)])


def nameless_functions(screening: Screening, model: Model) -> list[Signature]:
    """Functions without a name that act together beside a model."""
    return _chosen(screening, model)[1]


def _refitted(screening: Screening, model: Model, chosen: Sequence[Signature]) -> float:
    """Evidence of functions with everything else fitted anew beside them [nats]."""
    problem, start = screening.problem, model.fitted
    columns, prior = np.column_stack([s.columns for s in chosen]), sum(s.prior for s in chosen)
    gains = []
    for scale in SIZES:
        beside = problem.beside(columns * scale)
        fitted = beside.descend(start.effects, start.free, start.u, start.x)
        gain = fitted.log_evidence - start.log_evidence + prior
        gains.append(gain - (PAIR + _form(gain)) * (len(chosen) - 1))
    return max(gains)


def _chosen(screening: Screening, model: Model) -> tuple[float, list[Signature]]:
    """Evidence of the chosen functions together [nats], and which they are."""
    projection = without_harmonics(screening.problem, model.fitted)
    functions = screening.shapes(model)
    prior = np.array([s.prior for s in functions])
    ready = whitened(screening.problem.noise, functions)

    a, b = projection.project(np.column_stack([w.columns for w in ready]))
    ends = np.cumsum([w.columns.shape[1] for w in ready])
    parts = [np.arange(end - w.columns.shape[1], end) for w, end in zip(ready, ends, strict=True)]

    total = 0.0
    chosen: list[int] = []
    for _ in range(TOGETHER):
        tried = [
            _together(a, b, [parts[i] for i in (*chosen, k)]) + float(prior[[*chosen, k]].sum())
            for k in range(len(parts))
        ]
        best = int(np.argmax(tried))
        price = PAIR + _form(total) if chosen else 0.0
        if best in chosen or tried[best] - price <= total:
            break
        total, chosen = tried[best] - price, [*chosen, best]
    return total, [functions[i] for i in chosen]


def _together(a: Array, b: Array, parts: list[Index]) -> float:
    index = np.unique(np.concatenate(parts))
    return float(log_bayes(a[np.ix_(index, index)], b[index], (0,) * len(index)))


def _form(gained: float) -> float:
    return float(np.clip(FORM * gained, 0.0, FORM_MOST))
