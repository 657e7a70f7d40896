"""A run on one page: what was measured and predicted, what was learned, and whether the innovations
are honest.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.estimator.messages.status import Status
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.drawing import (
    AFTER,
    BAND,
    BEFORE,
    IDLE,
    INK,
    LINE,
    MEASURED,
    PAGE,
    SHADE,
    SOFT,
    WIDE,
    Name,
    band,
    last,
    look,
    named,
    save,
)

NS = 1_000_000_000
HEIGHT = 7.4  # [in]
UPDATES = {"torque": BEFORE, "drawbar_pull": AFTER}  # what the filter is updated with
DRAWN = 1200  # points a curve: more than half a page has pixels

SIGNALS = (  # field, label, factor to the unit shown
    ("slip", "slip [%]", 100.0),
    ("load", "load W [N]", 1.0),
    ("sinkage", "sinkage z [mm]", 1e3),
    ("torque", "torque T [N·m]", 1.0),
    ("drawbar_pull", "drawbar pull DP [N]", 1.0),
)
SOUGHT = (
    ("cohesion", "cohesion c [Pa]", 1.0),
    ("tan_phi", "tan φ", 1.0),
    ("shear_modulus", "shear modulus k [mm]", 1e3),
)


def draw(path: Path, ticks: Rows, title: str, truth: Mapping[str, float] | None = None) -> None:
    """Write the page, as PNG or SVG.

    ticks: /tick as an array (n,) by field name. truth: cohesion [Pa], tan_phi and shear_modulus
        [m], where known.
    """
    with look():
        figure = Figure(figsize=(PAGE, HEIGHT), layout="constrained")
        figure.suptitle(title, fontsize=9)
        left, right = figure.subfigures(1, 2, squeeze=False)[0]

        seconds = (ticks["stamp"] - ticks["stamp"][0]) / NS
        _signals(left.subplots(len(SIGNALS), 1, sharex=True), ticks, seconds)
        _learned(right.subplots(len(SOUGHT) + 1, 1, sharex=True), ticks, seconds, truth or {})
        save(figure, path)


def _signals(axes: Array, ticks: Rows, seconds: Array) -> None:
    some = slice(None, None, max(1, len(ticks) // DRAWN))

    for ax, (field, label, factor) in zip(axes, SIGNALS, strict=True):
        _shade_idle(ax, ticks, seconds)
        measured = ticks[field][some] * factor
        ax.plot(seconds[some], measured, color=MEASURED, lw=WIDE if field in UPDATES else LINE)
        names = [Name(last(measured), "measured", MEASURED)]

        if field in UPDATES:
            tracking = ticks["status"] == Status.TRACKING
            predicted = np.where(tracking, ticks[f"{field}_predicted"], np.nan)[some] * factor
            sigma = ticks[f"{field}_predicted_sigma"][some] * factor
            band(ax, seconds[some], predicted, sigma, AFTER)
            ax.plot(seconds[some], predicted, color=AFTER, lw=LINE)
            names.append(Name(last(predicted), "predicted", AFTER))

        _dress(ax, label, seconds, ticks[field][_steady(ticks)] * factor)
        named(ax, names if field in UPDATES else [])

    axes[0].set_title("Measured and predicted; shaded: not used by the filter")
    axes[-1].set_xlabel("time [s]")


def _learned(axes: Array, ticks: Rows, seconds: Array, truth: Mapping[str, float]) -> None:
    some = slice(None, None, max(1, len(ticks) // DRAWN))
    for ax, (field, label, factor) in zip(axes, SOUGHT, strict=False):
        value, sigma = ticks[field][some] * factor, ticks[f"{field}_sigma"][some] * factor
        band(ax, seconds[some], value, sigma, AFTER)
        ax.plot(seconds[some], value, color=AFTER, lw=LINE)

        names = [Name(last(value), "± 2σ", AFTER)]
        if field in truth:
            ax.axhline(truth[field] * factor, color=INK, lw=LINE, ls=(0, (4, 3)))
            names.append(Name(truth[field] * factor, "truth", INK))
        _dress(ax, label, seconds, np.concatenate((value - BAND * sigma, value + BAND * sigma)))
        named(ax, names)
        ax.set_title(_closing(field, ticks, truth), loc="right", fontweight="normal", color=SOFT)

    axes[0].set_title("Learned")
    _innovations(axes[-1], ticks, seconds)


def _closing(field: str, ticks: Rows, truth: Mapping[str, float]) -> str:
    """The last estimate in words, compared with the truth."""
    value, sigma = float(ticks[field][-1]), float(ticks[f"{field}_sigma"][-1])
    factor = dict((name, factor) for name, _, factor in SOUGHT)[field]
    digits = {"cohesion": 0, "tan_phi": 4, "shear_modulus": 2}[field]
    text = f"at the end {value * factor:.{digits}f} ± {sigma * factor:.{digits}f}"
    return text + (f", truth {truth[field] * factor:.{digits}f}" if field in truth else "")


def _innovations(ax: Axes, ticks: Rows, seconds: Array) -> None:
    """Innovation over its stated standard deviation, one point an update."""
    ax.axhspan(-BAND, BAND, color=AFTER, alpha=SHADE, lw=0, zorder=0)

    for (field, colour), mark in zip(UPDATES.items(), (".", "+"), strict=True):
        offered = ticks[f"{field}_s"] > 0.0
        normalised = ticks[f"{field}_innovation"][offered] / np.sqrt(ticks[f"{field}_s"][offered])
        words = f"{field.replace('_', ' ')}, {_inside(normalised)} in ± 2"
        ax.plot(seconds[offered], normalised, mark, ms=3, mew=0.6, color=colour, label=words)

    ax.set_ylim(-5, 7.5)
    ax.set_yticks((-4, -2, 0, 2, 4))
    ax.set_ylabel("innovation / σ")
    ax.set_xlabel("time [s]")
    ax.set_title("Normalised innovations, one an update")
    ax.legend(loc="upper left", ncols=1, handletextpad=0.2, borderaxespad=0.1, labelspacing=0.2)


def _inside(normalised: Array) -> str:
    return f"{np.mean(np.abs(normalised) <= BAND):.0%}" if normalised.size else "none"


def _shade_idle(ax: Axes, ticks: Rows, seconds: Array) -> None:
    """Grey where the filter was not updated or not believed, and why is in the status."""
    idle = np.concatenate(([0], (ticks["status"] != Status.TRACKING).astype(int), [0]))
    edges = np.flatnonzero(np.diff(idle))
    end = len(seconds) - 1
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        ax.axvspan(seconds[start], seconds[min(stop, end)], color=IDLE, lw=0, zorder=0)


def _steady(ticks: Rows) -> Array:
    """Where the wheel was tracked; everywhere, if it never was."""
    tracking: Array = ticks["status"] == Status.TRACKING
    return tracking if tracking.any() else np.logical_not(tracking)


def _dress(ax: Axes, label: str, seconds: Array, scale: Array) -> None:
    """Label and limits: `scale` sets the vertical ones, with a margin."""
    finite = scale[np.isfinite(scale)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    margin = 0.12 * max(high - low, 1e-9)
    ax.set_ylim(low - margin, high + margin)
    ax.set_xlim(seconds[0], seconds[-1])
    ax.set_ylabel(label)
