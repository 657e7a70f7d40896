"""One look for all figures: colours that differ in grey too, σ as a shaded band, names at the
curves, letters that are read at the width of a column. Only what draws loads matplotlib.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.estimator.terramechanics.soil import Array

# lightness L* of 73, 48, 30: apart in print and for the colour-blind; style.css has the same
MEASURED, BEFORE, AFTER = "#a9b6c1", "#c24e1a", "#004f5c"
PRIOR, INK, SOFT, RULE, IDLE = "#5f6d78", "#1c2329", "#52606b", "#d9dfe4", "#eef1f3"
WIDE, LINE, FINE = 2.6, 1.2, 0.8  # [pt] measured below what is drawn into it; a curve; a residual
SHADE = 0.18  # opacity of a band
BAND = 2.0  # [σ] half width of a band
COLUMN, PAGE = 3.5, 7.2  # [in] widths in a journal
DPI = 150  # [1/in]
APART = 0.1  # of the axes' height: names at curves keep so far from each other
LOOK: Any = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.edgecolor": SOFT,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": RULE,
    "grid.linewidth": 0.5,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": LINE,
    "lines.solid_capstyle": "round",
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "svg.fonttype": "none",  # words stay words
    "svg.hashsalt": "gritd",  # the same picture, the same file
}


class Name(NamedTuple):
    """What a curve is called, where it ends."""

    at: float  # its last value
    words: str
    colour: str


def look() -> Any:
    """A context in which all is drawn and saved."""
    return rc_context(LOOK)


def save(figure: Figure, path: Path) -> None:
    """As SVG where the file's name ends so, as PNG otherwise; without a date. Raises OSError."""
    kind = "svg" if path.suffix.lower() == ".svg" else "png"
    unstamped = {"Date": None} if kind == "svg" else {"Software": None}
    figure.savefig(path, format=kind, metadata=unstamped)


def band(ax: Axes, x: Array, value: Array, sigma: Array, colour: str) -> None:
    """± 2σ around a curve, all (n,)."""
    low, high = value - BAND * sigma, value + BAND * sigma
    ax.fill_between(x, low, high, color=colour, alpha=SHADE, lw=0)


def noise(ax: Axes, sigma: float) -> None:
    """± 2σ around zero, where a residual is noise."""
    if np.isfinite(sigma):
        ax.axhspan(-BAND * sigma, BAND * sigma, color=MEASURED, alpha=SHADE * 2, lw=0, zorder=0)


def last(y: Array) -> float:
    """The last finite value of y (n,); NaN where there is none."""
    known = y[np.isfinite(y)]
    return float(known[-1]) if known.size else float("nan")


def named(ax: Axes, names: Iterable[Name], apart: float = APART) -> None:
    """Names right of the axes, at the ends of their curves and so far from each other [share of
    the axes' height]; the axes have their limits by now.
    """
    low, high = ax.get_ylim()
    placed = sorted((n for n in names if np.isfinite(n.at)), key=lambda n: n.at)
    heights = spread([(n.at - low) / (high - low) for n in placed], apart)
    for name, height in zip(placed, heights, strict=True):
        ax.annotate(
            name.words,
            (1.0, height),
            xycoords="axes fraction",
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            color=name.colour if name.colour != MEASURED else SOFT,
            fontsize=7.5,
            annotation_clip=False,
        )


def spread(heights: Sequence[float], apart: float) -> list[float]:
    """Rising heights (n,), each `apart` from the next: pushed up from the lowest on, then down from
    1 where they went beyond.
    """
    moved: list[float] = []
    for height in heights:
        least = moved[-1] + apart if moved else 0.0
        moved.append(max(min(max(height, 0.0), 1.0), least))

    limit = 1.0
    for at in reversed(range(len(moved))):
        moved[at] = min(moved[at], limit)
        limit = moved[at] - apart
    return moved
