"""Small pictures in SVG: scales, axes and marks. Coordinates are pixels of a picture W wide;
colours are CSS classes.

A picture is as wide as a phone, and a page puts several in a row where there is room; so its text
is never scaled down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import fixed
from gritd.tools.report.html import Child, Markup, tag

W = 360.0  # [px] of every picture
LEFT, RIGHT = 44.0, 8.0  # margins of the axes: room for tick labels
MOST = 440  # points a line: more than a panel has pixels


@dataclass(frozen=True)
class Scale:
    """Data low … high onto pixels start … end."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, values: Array | float) -> Array:
        share = (np.asarray(values, dtype=float) - self.low) / (self.high - self.low)
        return self.start + share * (self.end - self.start)


@dataclass(frozen=True)
class Axes:
    """A rectangle with a horizontal and a vertical scale."""

    x: Scale
    y: Scale

    def clipped(self, *marks: Child) -> Markup:
        """Marks in the coordinates of the picture, cut at the edge of the axes."""
        left, top = min(self.x.start, self.x.end), min(self.y.start, self.y.end)
        width, height = abs(self.x.end - self.x.start), abs(self.y.end - self.y.start)
        box = f"{left:g} {top:g} {width:g} {height:g}"
        return tag("svg", *marks, x=left, y=top, width=width, height=height, viewBox=box)


def picture(height: float, label: str, *marks: Child) -> Markup:
    """The whole picture; `label` says in words what is to be seen."""
    return tag(
        "svg",
        tag("title", label),
        *marks,
        class_="plot",
        viewBox=f"0 0 {W:g} {height:g}",
        role="img",
    )


def axes(x: tuple[float, float], y: tuple[float, float], top: float, bottom: float) -> Axes:
    """Axes between two heights [px], for limits of the data."""
    return Axes(Scale(*x, LEFT, W - RIGHT), Scale(*y, bottom, top))


def limits(
    *values: Array | Sequence[float], margin: float = 0.06, keep: float | None = None
) -> tuple[float, float]:
    """Least and greatest finite value with a margin; `keep` is inside too. Never empty. values: of
    any shape, (n,) or other, all in the unit of the result.
    """
    every = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values] or [np.zeros(0)])
    every = every[np.isfinite(every)]
    if keep is not None:
        every = np.append(every, keep)

    low, high = (float(every.min()), float(every.max())) if every.size else (0.0, 1.0)
    room = margin * (high - low) or 0.05 * abs(high) or 0.5
    return low - room, high + room


def ticks(low: float, high: float, most: int = 5) -> list[float]:
    """At most `most` round values inside low … high, in steps of 1, 2 or 5 times a power of ten."""
    raw = (high - low) / most
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(next(s * power for s in (1.0, 2.0, 5.0, 10.0) if s * power >= raw * (1.0 - 1e-9)))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return [i * step for i in range(first, last + 1)][:most]


def tick_labels(values: Sequence[float]) -> list[str]:
    """As many decimals as the step between them needs."""
    step = min((b - a for a, b in pairwise(values)), default=1.0)
    places = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return [fixed(v + 0.0, places) if abs(v) > 1e-9 * step else "0" for v in values]


def frame(
    at: Axes,
    label: str,
    *,
    below: str | None = None,
    most: int = 5,
    names: Sequence[str] | None = None,
) -> Markup:
    """Grid, tick labels, the vertical axis's label on top; `below` names the horizontal axis, None
    leaves it bare.

    names: stand at 0, 1, 2 … on the horizontal axis in place of numbers.
    """
    heights = ticks(at.y.low, at.y.high, most)
    parts = []
    for value, words in zip(heights, tick_labels(heights), strict=True):
        height = float(at.y(value))
        ends = {"x1": at.x.start, "x2": at.x.end, "y1": height, "y2": height}
        parts.append(tag("line", class_="grid tick", **ends))
        parts.append(text(at.x.start - 6, height + 3.5, words, "end", "tick"))

    parts.append(text(at.x.start, at.y.end - 6, label, "start", "label"))

    if below is not None:
        widths = (
            ticks(at.x.low, at.x.high, 6)
            if names is None
            else [float(i) for i in range(len(names))]
        )
        for value, words in zip(
            widths, names if names is not None else tick_labels(widths), strict=True
        ):
            parts.append(text(float(at.x(value)), at.y.start + 14, words, "middle", "tick"))
        parts.append(text(at.x.end, at.y.start + 28, below, "end", "label"))

    zoomed = {} if names is not None else _ranges(at, below, most)
    return tag("g", parts, **zoomed)


def _ranges(at: Axes, below: str | None, most: int) -> dict[str, str | float | None]:
    """What the page's script needs to draw other ticks: low, high, start and end of both axes."""
    return {
        **{
            f"data_{name}": f"{scale.low:.9g} {scale.high:.9g} {scale.start:g} {scale.end:g}"
            for name, scale in (("x", at.x), ("y", at.y))
        },
        "data_most": f"{most}",
        "data_below": None if below is None else "1",
    }


def text(
    x: float, y: float, words: str, anchor: str = "start", class_: str | None = None
) -> Markup:
    return tag("text", words, x=x, y=y, text_anchor=anchor, class_=class_)


def line(at: Axes, x: Array | Sequence[float], y: Array | Sequence[float], class_: str) -> Markup:
    """Through x, y (n,); broken where a value is not finite, thinned without losing an extreme."""
    xs, ys = thinned(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    pieces, pen = [], "M"
    for px, py in zip(at.x(xs).tolist(), at.y(ys).tolist(), strict=True):
        if not np.isfinite(px + py):
            pen = "M"
            continue
        pieces.append(f"{pen}{px:.1f} {np.clip(py, -1e4, 1e4):.1f}")
        pen = "L"
    return at.clipped(tag("path", class_=class_, d="".join(pieces)))


def ribbon(at: Axes, x: Array, low: Array, high: Array, class_: str) -> Markup:
    """The area between two curves over x, all (n,); of many points the outermost of each stretch.
    Where an edge is not finite there is none.
    """
    good = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    x, low, high = x[good], low[good], high[good]
    if not len(x):
        return at.clipped()
    starts = np.arange(0, len(x), -(-len(x) // MOST))
    edges = (np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)[::-1])
    across = at.x(np.concatenate((x[starts], x[starts][::-1])))
    upright = np.clip(at.y(np.concatenate(edges)), -1e4, 1e4)

    points = zip(across.tolist(), upright.tolist(), strict=True)
    path = "L".join(f"{px:.1f} {py:.1f}" for px, py in points)
    return at.clipped(tag("path", class_=class_, d=f"M{path}Z"))


def uprights(at: Axes, places: Sequence[float], class_: str) -> Markup:
    """A line over the whole height at each place along the horizontal axis."""
    marks = [
        tag("line", class_=class_, x1=x, x2=x, y1=at.y.start, y2=at.y.end)
        for x in at.x(np.asarray(places, dtype=float)).tolist()
        if np.isfinite(x)
    ]
    return at.clipped(*marks)


def thinned(x: Array, y: Array, most: int = MOST) -> tuple[Array, Array]:
    """Of each stretch of x, y (n,) its least and greatest value, in order; all where n is small."""
    if len(x) <= most:
        return x, y
    kept = [
        part[0] + np.unique([0, *_extremes(y[part]), len(part) - 1])
        for part in np.array_split(np.arange(len(x)), most // 4)
    ]
    some = np.concatenate(kept)
    return x[some], y[some]


def _extremes(y: Array) -> tuple[int, int]:
    finite = np.isfinite(y)
    if not finite.any():
        return 0, 0
    return int(np.argmin(np.where(finite, y, np.inf))), int(np.argmax(np.where(finite, y, -np.inf)))


def dots(at: Axes, x: Array, y: Array, class_: str) -> Markup:
    """One path of round dots at x, y (n,): a tenth of the size of as many circles."""
    good = np.isfinite(x) & np.isfinite(y)
    places = zip(at.x(x[good]).tolist(), at.y(y[good]).tolist(), strict=True)
    return at.clipped(
        tag("path", class_=class_, d="".join(f"M{px:.1f} {py:.1f}h0" for px, py in places))
    )


def band(at: Axes, low: float, high: float, class_: str = "band") -> Markup:
    """The height between two values, over the whole width."""
    top, bottom = float(at.y(high)), float(at.y(low))

    return at.clipped(
        tag(
            "rect",
            class_=class_,
            x=at.x.start,
            y=top,
            width=at.x.end - at.x.start,
            height=bottom - top,
        )
    )


def stretches(at: Axes, x: Array, marked: Array, class_: str) -> Markup | None:
    """Shade where `marked` is true, (n,) along x."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], marked.astype(int), [0]))))
    if not edges.size:
        return None

    place, last = at.x(x), len(x) - 1
    parts = []
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        left, right = float(place[start]), float(place[min(end, last)])
        if np.isfinite(left + right) and right > left:
            height = at.y.start - at.y.end
            parts.append(
                tag("rect", class_=class_, x=left, y=at.y.end, width=right - left, height=height)
            )

    return at.clipped(*parts)
