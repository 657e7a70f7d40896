"""A run on one page: what was measured and predicted, what was learned, and whether the innovations
are honest.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from gritd.estimator.messages.status import Status
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.terramechanics.soil import Array

NS = 1_000_000_000
SIZE, DPI = (16.0, 10.5), 100  # [in], [1/in]
MEASURED, PREDICTED, ESTIMATE, TRUTH, IDLE = "#8fa3b5", "#c1121f", "#00798c", "#111111", "#eceff1"
UPDATES = {"torque": "#c77800", "drawbar_pull": "#6a4c93"}  # what the filter is updated with
WIDTH = (1.8, 4.0)  # [pt] of measured curves; the wide ones have a prediction drawn into them
DRAWN = 3000  # points a curve: more than the page has pixels

SIGNALS = (  # field, label, factor to the unit shown
    ("slip", "slip [%]", 100.0),
    ("load", "load W [N]", 1.0),
    ("sinkage", "sinkage z [mm]", 1e3),
    ("torque", "torque T [N·m]", 1.0),
    ("drawbar_pull", "drawbar pull DP [N]", 1.0),
)
SOUGHT = (
    ("cohesion", "cohesion c [Pa]", 1.0),
    ("tan_phi", "tan φ [–]", 1.0),
    ("shear_modulus", "shear modulus k [mm]", 1e3),
)


def draw(path: Path, ticks: Rows, title: str, truth: Mapping[str, float] | None = None) -> None:
    """Write the page as PNG.

    ticks: /tick as an array (n,) by field name. truth: cohesion [Pa], tan_phi and shear_modulus
        [m], where known.
    """
    figure = Figure(figsize=SIZE, dpi=DPI, layout=ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.04))
    left, right = figure.subfigures(1, 2, squeeze=False)[0]
    figure.suptitle(title, fontsize=13)

    seconds = (ticks["stamp"] - ticks["stamp"][0]) / NS
    _signals(left.subplots(len(SIGNALS), 1, sharex=True), ticks, seconds)
    _learned(right.subplots(len(SOUGHT) + 1, 1, sharex=True), ticks, seconds, truth or {})

    figure.savefig(path)


def _signals(axes: Array, ticks: Rows, seconds: Array) -> None:
    some = slice(None, None, max(1, len(ticks) // DRAWN))

    for ax, (field, label, factor) in zip(axes, SIGNALS, strict=True):
        _shade_idle(ax, ticks, seconds)
        ax.plot(
            seconds[some],
            ticks[field][some] * factor,
            color=MEASURED,
            lw=WIDTH[field in UPDATES],
            label="measured",
        )
        if field in UPDATES:
            tracking = np.where(
                ticks["status"] == Status.TRACKING, ticks[f"{field}_predicted"], np.nan
            )
            ax.plot(
                seconds[some],
                tracking[some] * factor,
                color=PREDICTED,
                lw=1.2,
                label="predicted at the estimate",
            )
        _dress(ax, label, seconds, ticks[field][_steady(ticks)] * factor)

    axes[0].set_title(
        "Measured and predicted   (shaded: not used by the filter)", fontsize=11, loc="left"
    )
    axes[3].legend(loc="upper left", ncols=2, fontsize=9, frameon=False)
    axes[-1].set_xlabel("time [s]")


def _learned(axes: Array, ticks: Rows, seconds: Array, truth: Mapping[str, float]) -> None:
    some = slice(None, None, max(1, len(ticks) // DRAWN))
    for ax, (field, label, factor) in zip(axes, SOUGHT, strict=False):
        value, sigma = ticks[field] * factor, ticks[f"{field}_sigma"] * factor
        low, high = (value - 2 * sigma)[some], (value + 2 * sigma)[some]
        ax.fill_between(seconds[some], low, high, color=ESTIMATE, alpha=0.18, lw=0, label="± 2σ")
        ax.plot(seconds[some], value[some], color=ESTIMATE, lw=1.6, label="estimate")

        if field in truth:
            ax.axhline(truth[field] * factor, color=TRUTH, lw=1.2, ls=(0, (6, 3)), label="truth")
        _dress(ax, label, seconds, np.concatenate((low, high)))

        ax.text(
            0.995,
            0.95,
            _closing(field, ticks, truth),
            transform=ax.transAxes,
            ha="right",
            va="top",
            fontsize=10,
        )

    axes[0].set_title("Learned", fontsize=11, loc="left")
    axes[0].legend(loc="lower right", ncols=3, fontsize=9, frameon=False)
    _innovations(axes[-1], ticks, seconds)


def _closing(field: str, ticks: Rows, truth: Mapping[str, float]) -> str:
    """The last estimate in words, beside the truth."""
    value, sigma = float(ticks[field][-1]), float(ticks[f"{field}_sigma"][-1])
    factor = dict((name, factor) for name, _, factor in SOUGHT)[field]
    digits = {"cohesion": 0, "tan_phi": 4, "shear_modulus": 2}[field]
    text = f"{value * factor:.{digits}f} ± {sigma * factor:.{digits}f}"
    return (
        f"at the end {text}, truth {truth[field] * factor:.{digits}f}"
        if field in truth
        else f"at the end {text}"
    )


def _innovations(ax: Axes, ticks: Rows, seconds: Array) -> None:
    """Innovation over its stated standard deviation, one point an update."""
    ax.axhspan(-2, 2, color=ESTIMATE, alpha=0.10, lw=0)
    ax.axhline(0, color="#b0bec5", lw=0.8)

    for field, color in UPDATES.items():
        offered = ticks[f"{field}_s"] > 0.0
        normalised = ticks[f"{field}_innovation"][offered] / np.sqrt(ticks[f"{field}_s"][offered])
        name = field.replace("_", " ")
        ax.plot(
            seconds[offered],
            normalised,
            ".",
            ms=4,
            color=color,
            alpha=0.75,
            label=f"{name} ({_inside(normalised)} in ± 2)",
        )

    ax.set_ylim(-5, 5)
    ax.set_ylabel("innovation / σ [–]")
    ax.set_xlabel("time [s]")
    ax.set_title("Normalised innovations, one an update", fontsize=11, loc="left")
    ax.legend(loc="upper right", ncols=2, fontsize=9, frameon=False)
    plain(ax)


def _inside(normalised: Array) -> str:
    return f"{np.mean(np.abs(normalised) <= 2.0):.0%}" if normalised.size else "none"


def _shade_idle(ax: Axes, ticks: Rows, seconds: Array) -> None:
    """Grey where the filter was not updated or not believed, and why is in the status."""
    idle = np.concatenate(([0], (ticks["status"] != Status.TRACKING).astype(int), [0]))
    edges = np.flatnonzero(np.diff(idle))
    last = len(seconds) - 1
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        ax.axvspan(seconds[start], seconds[min(end, last)], color=IDLE, lw=0, zorder=0)


def _steady(ticks: Rows) -> Array:
    """Where the wheel was tracked; everywhere, if it never was."""
    tracking: Array = ticks["status"] == Status.TRACKING
    return tracking if tracking.any() else np.logical_not(tracking)


def _dress(ax: Axes, label: str, seconds: Array, scale: Array) -> None:
    """Label and limits: `scale` sets the vertical ones, with a margin."""
    finite = scale[np.isfinite(scale)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
    margin = 0.12 * max(high - low, 1e-9)
    ax.set_ylim(low - margin, high + 1.8 * margin)
    ax.set_xlim(seconds[0], seconds[-1])
    ax.set_ylabel(label)
    plain(ax)


def plain(ax: Axes) -> None:
    """A faint grid, no box."""
    ax.grid(color="#dde3e7", lw=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
