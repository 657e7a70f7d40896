"""What was stated of the soil, what is left of that while the wheel drives, and the truth: one
picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.estimator.messages.status import Status
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.drawing import AFTER, BAND, INK, LINE, PAGE, PRIOR, SHADE, SOFT, look, save

NS = 1_000_000_000
HEIGHT = 2.5  # [in]
DRAWN = 1200  # points a curve
LEAST = 5.0  # [N] between loads, [s] of one
TOP_RIGHT = 17  # of the 73 points of an outline
DASHED = (0, (4, 3))
AXES = (("cohesion", "cohesion c [Pa]"), ("tan_phi", "friction tan φ"))


def draw(path: Path, ticks: Rows, truth: Mapping[str, float]) -> None:
    """Write it, as PNG or SVG.

    ticks: /tick as an array (n,) by field name, from a start at the prior; truth: cohesion [Pa]
        and tan_phi.
    """
    seconds = (ticks["stamp"] - ticks["stamp"][0]) / NS
    loads = list(_loads(ticks, seconds))

    with look():
        figure = Figure(figsize=(PAGE, HEIGHT), layout="constrained")
        axes = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 0.9))
        for ax, (field, label) in zip(axes, AXES, strict=False):
            _along_time(ax, ticks, seconds, field, truth[field])
            _tell_loads(ax, seconds, loads)
            ax.set_title(label)
        _plane(axes[-1], ticks, [last for _, last in loads], truth)
        save(figure, path)


def _loads(ticks: Rows, seconds: Array) -> Iterator[tuple[float, int]]:
    """Each load that was held [N], and the row where it ended."""
    some = np.flatnonzero(ticks["status"] == Status.TRACKING)[:: max(1, len(ticks) // DRAWN)]
    load, begin = ticks["load"], 0
    for at, row in enumerate(some.tolist(), start=1):
        ends = at == some.size or abs(load[some[at]] - load[row]) > LEAST
        if ends and seconds[row] - seconds[some[begin]] > LEAST:
            yield float(np.median(load[some[begin:at]])), row
        begin = at if ends else begin


def _along_time(ax: Axes, ticks: Rows, seconds: Array, field: str, truth: float) -> None:
    value, sigma = ticks[field], ticks[f"{field}_sigma"]
    stated, spread = float(value[0]), BAND * float(sigma[0])
    ax.axhspan(stated - spread, stated + spread, color=PRIOR, alpha=SHADE / 2, lw=0)

    some = slice(None, None, max(1, len(ticks) // DRAWN))
    low, high = value[some] - BAND * sigma[some], value[some] + BAND * sigma[some]
    ax.fill_between(seconds[some], low, high, color=AFTER, alpha=2 * SHADE, lw=0)
    ax.plot(seconds[some], value[some], color=AFTER, lw=LINE)
    ax.axhline(truth, color=INK, lw=LINE, ls=DASHED)

    ax.set_ylim(stated - 1.1 * spread, stated + 1.35 * spread)
    ax.set_xlim(seconds[0], seconds[-1])
    ax.set_xlabel("time [s]")
    by_share = ax.get_yaxis_transform()  # share of the axes, value
    words: Any = {"transform": by_share, "fontsize": 7.5, "ha": "right", "va": "center"}
    side = 1.0 if truth > stated else -1.0
    ax.text(0.98, stated - 0.9 * side * spread, "stated before", color=SOFT, **words)
    ax.text(0.98, truth + 0.22 * side * spread, "truth", color=INK, **words)


def _tell_loads(ax: Axes, seconds: Array, loads: list[tuple[float, int]]) -> None:
    """The load on the wheel, above where it was driven."""
    above = ax.get_xaxis_transform()  # time, share of the axes
    begins = [0, *(last for _, last in loads)]
    for (load, last), begin in zip(loads, begins, strict=False):
        middle = (seconds[begin] + seconds[last]) / 2
        ax.text(middle, 0.93, f"{load:.0f} N", transform=above, ha="center", color=SOFT)
    for last in begins[1:-1]:
        ax.axvline(seconds[last], color=SOFT, lw=LINE / 2, ls=(0, (1, 2)))


def _plane(ax: Axes, ticks: Rows, rows: list[int], truth: Mapping[str, float]) -> None:
    """Both together: as stated, after the first load, and at the end."""
    ax.plot(*_ellipse(ticks[0]), color=PRIOR, lw=LINE, ls=DASHED)
    drawn = {rows[0]: "one load", rows[-1]: f"{len(rows)} loads"} if rows else {}
    for row, words in drawn.items():
        c, tan_phi = _ellipse(ticks[row])
        ax.fill(c, tan_phi, color=AFTER, alpha=2 * SHADE, lw=0)
        ax.plot(c, tan_phi, color=AFTER, lw=LINE)
        at = (c[TOP_RIGHT], tan_phi[TOP_RIGHT])
        ax.annotate(words, at, textcoords="offset points", xytext=(5, 2), color=AFTER)

    ax.plot(truth["cohesion"], truth["tan_phi"], "+", color=INK, ms=6, mew=1.2)
    ax.set_xlabel("cohesion c [Pa]")
    ax.set_title("c and tan φ within 2σ")


def _ellipse(tick: Rows) -> tuple[Array, Array]:
    """Outline within 2σ: c [Pa] and tan φ, (73,) each."""
    turn = np.linspace(0.0, 2 * np.pi, 73)
    spread_c, spread_t = float(tick["cohesion_sigma"]), float(tick["tan_phi_sigma"])
    rho = float(np.clip(tick["cov_c_tan_phi"] / (spread_c * spread_t), -1.0, 1.0))
    along = rho * np.cos(turn) + np.sqrt(1.0 - rho * rho) * np.sin(turn)
    return (
        tick["cohesion"] + BAND * spread_c * np.cos(turn),
        tick["tan_phi"] + BAND * spread_t * along,
    )
