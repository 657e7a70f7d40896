"""Reference and new campaign side by side: what the model leaves of both with nothing new."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gritd.tools.cli.wording import shown
from gritd.tools.diagnose.explain.result import Diagnosis, Scatter, Trace
from gritd.tools.report import figures, front, plot
from gritd.tools.report.html import Markup, section, table, tag
from gritd.tools.report.words import name_of, with_unit

TITLE = "Reference and new campaign"
SIDES = ("reference", "new campaign")
MEANS = (
    "Recorded less simulated, with nothing new in the model. What both sides show, this rig does"
    " anyway. What the new campaign alone shows is new."
)


def campaigns(diagnosis: Diagnosis) -> Markup | None:
    """The section; None where there was no reference."""
    if diagnosis.reference is None or not diagnosis.traces:
        return None

    head = ["channel", *SIDES, f"{SIDES[1]}, with {front.explanation(diagnosis)}", "noise"]
    rows = [
        _row(diagnosis, channel) for channel in dict.fromkeys(t.channel for t in diagnosis.traces)
    ]
    legend = figures.legend({"mean": "mean", "band": "± 2σ of the noise"})

    drawn = [
        figures.figure(_caption(scatter), _pictures(diagnosis, scatter), legend=legend, small=True)
        for scatter in _along_conditions(diagnosis.scatters)
    ]
    return section(TITLE, tag("p", MEANS), table(head, rows, numbers=1), drawn)


def _row(diagnosis: Diagnosis, channel: str) -> tuple[str, ...]:
    """r.m.s. of what is left in the channel of both campaigns."""
    of = [trace for trace in diagnosis.traces if trace.channel == channel]
    count = _referred(diagnosis)
    values = (
        _rms(of[:count], "before"),
        _rms(of[count:], "before"),
        _rms(of[count:], "after"),
        diagnosis.fit.noise_floor.get(channel),
    )
    return (name_of(channel), *(with_unit(value, of[0].unit) for value in values))


def _rms(of: Sequence[Trace], which: str) -> float | None:
    """Of the runs' used values together; None without any."""
    left = [np.asarray(t.measured, float) - np.asarray(getattr(t, which), float) for t in of]
    values = np.concatenate(left) if left else np.zeros(0)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def _referred(diagnosis: Diagnosis) -> int:
    """How many runs are the reference's: they come first."""
    return len(diagnosis.reference.files) if diagnosis.reference else 0


# --- pictures ---


def _along_conditions(scatters: Sequence[Scatter]) -> Iterator[Scatter]:
    """One of each channel and covariate; run by run both campaigns are in one picture already."""
    latest = {(s.channel, figures.drawn_against(s)): s for s in reversed(scatters)}
    yield from (s for (_, against), s in reversed(latest.items()) if against != "run")


def _caption(scatter: Scatter) -> str:
    about = f"{name_of(scatter.channel)} against {name_of(figures.drawn_against(scatter))}"
    return f"Residual of {about}, with nothing new in the model."


def _pictures(diagnosis: Diagnosis, scatter: Scatter) -> Markup:
    """Both campaigns on the same axes."""
    new = np.asarray(scatter.run, dtype=int) >= _referred(diagnosis)
    unit, factor = shown(scatter.unit)
    x, name, x_limits, _ = figures.along(scatter)
    left = np.asarray(scatter.before, float) * factor
    sigma = figures.known(scatter.sigma) * factor
    y_limits = plot.limits(left, [-2 * sigma, 2 * sigma], keep=0.0)
    at = plot.axes(x_limits, y_limits, 20.0, 190.0)

    panels = []
    for side, own in zip(SIDES, (~new, new), strict=True):
        label = f"Residual of {name_of(scatter.channel)} against {name}, {side}"
        marks = (
            plot.band(at, -2 * sigma, 2 * sigma),
            plot.frame(at, f"residual [{unit or '–'}]", below=name),
            plot.dots(at, *figures.some(x[own], left[own]), "dots before"),
            plot.line(at, *figures.running_mean(x[own], left[own]), "line mean"),
        )
        panels.append(figures.panel(side, plot.picture(224.0, label, *marks)))
    return figures.panels(panels)
