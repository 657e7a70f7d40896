"""The pictures of a report: time traces with their residual, residual against a covariate,
estimates side by side.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gritd.estimator.offline.windows import group_means
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import covariate_shown, number, shown
from gritd.tools.diagnose.explain.result import Quantity, Scatter, SoilFit, Trace
from gritd.tools.report import plot
from gritd.tools.report.html import Child, Markup, tag
from gritd.tools.report.words import counted, held, name_of, quantity

BINS = 12  # of a scatter's running mean
FEWEST = 4  # values in a bin
COLUMN = 0.7  # width of a run's column, of the distance between runs
MOST_LETTERS = 40  # of all names under a picture
PRINTED = 6  # runs: of more, the folded ones are not printed
SCATTERED = 1500  # dots a panel
TURN = 2.0 * np.pi


class PanelHeights(NamedTuple):
    """Heights [px] of a trace panel: the signal, the residual under it, the whole."""

    signal: tuple[float, float] = (20.0, 128.0)
    residual: tuple[float, float] = (154.0, 210.0)
    height: float = 244.0


ROWS = PanelHeights()


def figure(
    caption: str,
    *content: Child,
    legend: Child = None,
    small: bool = False,
    whole: bool = False,
) -> Markup:
    """`small` and `whole` figures are never parted by a page break."""
    return tag(
        "figure",
        legend,
        *content,
        tag("figcaption", held(caption)),
        class_="small" if small else "whole" if whole else None,
    )


def panels(items: Iterable[Child]) -> Markup:
    return tag("div", *items, class_="panels")


def panel(title: str, drawing: Markup, note: str = "") -> Markup:
    """`note` is never cut, a long title is."""
    head = tag("p", tag("b", title, title=title), tag("span", note), class_="panel-title")
    return tag("div", head, drawing, class_="panel")


def legend(entries: Mapping[str, str]) -> Markup:
    """Class of a mark -> what it is."""
    return tag(
        "ul",
        (tag("li", tag("i", class_=f"swatch {c}"), meaning) for c, meaning in entries.items()),
        class_="legend",
    )


# --- traces ---


def differs(trace: Trace | Scatter) -> bool:
    """Whether the explanation changes the prediction at all."""
    return not np.array_equal(
        np.asarray(trace.before, float), np.asarray(trace.after, float), equal_nan=True
    )


def rms(trace: Trace, which: str) -> float:
    """Root mean square residual [the trace's unit] over the samples compared; NaN where there are
    none.
    """
    used = np.asarray(trace.used, dtype=bool)
    residual = (np.asarray(trace.measured, float) - np.asarray(getattr(trace, which), float))[used]
    residual = residual[np.isfinite(residual)]
    return float(np.sqrt(np.mean(residual**2))) if residual.size else float("nan")


def traces(of: Sequence[Trace], most: int) -> Markup:
    """A panel a run: the `most` with the largest error in view and in their order, the others
    folded.
    """
    ranked = sorted(range(len(of)), key=lambda i: -np.nan_to_num(rms(of[i], "before")))
    first, rest = sorted(ranked[:most]), sorted(ranked[most:])
    seen = panels(trace_panel(of[i]) for i in first)

    if not rest:
        return seen
    summary = tag("summary", f"{counted(len(rest), 'more run')}, with smaller errors")
    more = tag("details", summary, panels(trace_panel(of[i]) for i in rest), class_=_printed(of))

    return tag("div", seen, more)


def _printed(of: Sequence[Trace]) -> str | None:
    """A campaign of many runs is printed with those in view alone."""
    return "unprinted" if len(of) > PRINTED else None


def channels(of: Sequence[Trace]) -> Markup:
    """The channels of one run side by side."""
    return panels(trace_panel(trace, name_of(trace.channel)) for trace in of)


def trace_panel(trace: Trace, title: str = "") -> Markup:
    """Under its run's name, or another title, with its error."""
    unit, factor = shown(trace.unit)
    error = number(rms(trace, "before") * factor, 2)
    if differs(trace):
        error += f" → {number(rms(trace, 'after') * factor, 2)}"
    return panel(title or trace.run, trace_picture(trace), f"rms {error} {unit}".rstrip())


def trace_picture(trace: Trace) -> Markup:
    """Recording and simulation; under them recorded − simulated on a scale of its own."""
    unit, factor = shown(trace.unit)
    time, used = np.asarray(trace.time, float) - trace.time[0], np.asarray(trace.used, bool)

    measured, before, after = (
        np.asarray(v, float) * factor for v in (trace.measured, trace.before, trace.after)
    )

    both = differs(trace)
    seen = used if used.any() else np.ones(time.shape, bool)
    span = (0.0, float(time[-1]) or 1.0)
    simulated = [(np.where(seen, before, np.nan), "before")] + (
        [(np.where(seen, after, np.nan), "after")] if both else []
    )

    top = plot.axes(span, plot.limits(measured[seen], before[seen], after[seen]), *ROWS.signal)
    noise = 2.0 * known(trace.sigma) * factor
    low = plot.axes(
        span, plot.limits(*(measured - s for s, _ in simulated), [-noise, noise]), *ROWS.residual
    )

    label = (
        f"{name_of(trace.channel)} of run {trace.run}: recording and simulation over time, "
        "with the residual below"
    )
    return plot.picture(
        ROWS.height,
        label,
        plot.stretches(top, time, ~used, "idle"),
        plot.stretches(low, time, ~used, "idle"),
        plot.frame(top, f"{name_of(trace.channel)} [{unit or '–'}]", most=4),
        plot.band(low, -noise, noise),
        plot.frame(low, "residual", below="time [s]", most=3),
        plot.line(top, time, measured, "line measured"),
        (plot.line(top, time, values, f"line {kind}") for values, kind in simulated),
        (
            plot.line(low, time, measured - values, f"line thin {kind}")
            for values, kind in simulated
        ),
    )


def known(sigma: float) -> float:
    """0 where no σ is known."""
    return sigma if np.isfinite(sigma) else 0.0


# --- residual against a covariate ---


def drawn_against(of: Scatter) -> str:
    """The covariate a scatter is drawn against: of a product the first; what is the same
    everywhere, run by run.
    """
    first = of.covariate.split("·")[0]
    return "run" if first == "constant" else first


def scatter(
    of: Scatter, explanation: str, runs: Sequence[str], changes: Sequence[float] = ()
) -> Markup:
    """Residuals without and with the explanation, on one scale; their mean through them.

    changes: values of the covariate at which the misfit starts or stops; of runs, the number of the
        first run beyond.
    """
    unit, factor = shown(of.unit)
    sides = [(f"without {explanation}", "before")] + (
        [(f"with {explanation}", "after")] if differs(of) else []
    )

    values = {kind: np.asarray(getattr(of, kind), float) * factor for _, kind in sides}
    sigma = known(of.sigma) * factor
    y_limits = plot.limits(*values.values(), [-2 * sigma, 2 * sigma], keep=0.0)

    x, name, x_limits, names = _by_run(of, runs) if drawn_against(of) == "run" else along(of)
    at = plot.axes(x_limits, y_limits, 20.0, 190.0)

    drawn = []
    for title, kind in sides:
        label = f"Residual of {name_of(of.channel)} against {name}, {title}"
        marks = (
            plot.band(at, -2 * sigma, 2 * sigma),
            plot.frame(at, f"residual [{unit or '–'}]", below=name, names=names),
            plot.dots(at, *some(x, values[kind]), f"dots {kind}"),
            plot.uprights(at, _marked(of, changes), "change") if changes else None,
            _levels(at, of, values[kind])
            if names
            else plot.line(at, *running_mean(x, values[kind]), "line mean"),
        )
        drawn.append(panel(title if len(sides) > 1 else "", plot.picture(224.0, label, *marks)))

    return panels(drawn)


def _marked(of: Scatter, changes: Sequence[float]) -> list[float]:
    """Change points on the horizontal axis: between two runs, or in the unit shown."""
    if drawn_against(of) == "run":
        return [change - 1.5 for change in changes]
    return [change * covariate_shown(of.covariate, of.covariate_unit)[1] for change in changes]


Along = tuple[
    Array, str, tuple[float, float], list[str] | None
]  # values, label, limits, names of 0, 1, 2 …


def along(of: Scatter) -> Along:
    """The covariate in the unit shown; angles of the wheel are folded into one turn."""
    covariate, x = drawn_against(of), np.asarray(of.x, float)
    unit, factor = covariate_shown(covariate, of.covariate_unit)
    x = (np.mod(x, TURN) if covariate == "wheel_angle" else x) * factor
    return x, name_of(covariate) + (f" [{unit}]" if unit else ""), plot.limits(x), None


def _by_run(of: Scatter, runs: Sequence[str]) -> Along:
    """A column a run, its values from left to right in order of time."""
    run = np.asarray(of.run, dtype=int)
    count = max([len(runs), *(run + 1).tolist()])

    x = run.astype(float)
    for each in np.unique(run):
        own = run == each
        x[own] += COLUMN * (np.arange(own.sum()) / max(own.sum() - 1, 1) - 0.5)

    longest = max(MOST_LETTERS // count, 1)
    names = [
        (n if len(n) <= longest else str(i + 1))
        for i, n in enumerate([*runs, *[""] * (count - len(runs))])
    ]

    return x, "run", (-0.5, count - 0.5), names


def _levels(at: plot.Axes, of: Scatter, values: Array) -> list[Markup]:
    """The mean of each run, as wide as its column."""
    run = np.asarray(of.run, dtype=int)
    means = [
        (each, float(np.nanmean(values[run == each])))
        for each in np.unique(run[np.isfinite(values)]).tolist()
    ]
    half = 0.5 * COLUMN
    return [
        plot.line(at, [each - half, each + half], [mean, mean], "line mean") for each, mean in means
    ]


def some(x: Array, y: Array) -> tuple[Array, Array]:
    """Of dots at x, y (n,) as many as a picture can show."""
    step = max(1, -(-len(x) // SCATTERED))
    return x[::step], y[::step]


def running_mean(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of x and y (n,) in bins of equal width; bins with too few values are left out."""
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size == 0 or np.ptp(x) == 0.0:
        return np.zeros(0), np.zeros(0)
    which = np.minimum(((x - x.min()) / np.ptp(x) * BINS).astype(int), BINS - 1)
    (at, count), (mean, _) = (group_means(which, values, BINS) for values in (x, y))
    kept = count >= FEWEST
    return at[kept], mean[kept]


# --- estimates ---


def soil(of: SoilFit) -> Markup:
    """Each soil parameter: known before, fitted without, fitted with the explanation; ±1σ thick,
    ±2σ thin.
    """
    known = ("known before", of.prior, "prior")
    rows = [known, ("fitted without", of.before, "before"), ("fitted with", of.after, "after")]

    if of.before == of.after:
        rows = [known, ("fitted", of.after, "after")]

    return panels(
        panel(
            name_of(key),
            intervals(name_of(key), [(label, side.get(key), kind) for label, side, kind in rows]),
        )
        for key in of.prior
    )


def intervals(name: str, rows: Sequence[tuple[str, Quantity | None, str]]) -> Markup:
    """Values with their uncertainty under each other, on one scale."""
    there = [(label, q, kind) for label, q, kind in rows if q is not None and np.isfinite(q.value)]
    ends = [q.value + s * known(q.sigma) for _, q, _ in there for s in (-2.0, 2.0)]
    across = plot.Scale(*plot.limits(ends), 88.0, 212.0)
    marks = [
        _interval(across, 14.0 + 24.0 * i, label, q, kind)
        for i, (label, q, kind) in enumerate(there)
    ]
    values = "; ".join(f"{label} {quantity(q)}" for label, q, _ in there)
    return plot.picture(8.0 + 24.0 * len(there), f"{name}: {values}", *marks)


def _interval(across: plot.Scale, y: float, label: str, q: Quantity, kind: str) -> Markup:
    at = {s: float(across(q.value + s * known(q.sigma))) for s in (-2, -1, 0, 1, 2)}
    return tag(
        "g",
        plot.text(0.0, y + 4.0, label),
        tag("line", class_=f"line thin {kind}", x1=at[-2], x2=at[2], y1=y, y2=y),
        tag("line", class_=f"line thick {kind}", x1=at[-1], x2=at[1], y1=y, y2=y),
        tag("circle", class_=f"mark {kind}", cx=at[0], cy=y, r=4.0),
        plot.text(224.0, y + 4.0, quantity(q)),
    )
