"""What the page draws along time: charts, the fields they are made of, and their units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from math import degrees
from typing import Any

import numpy as np

from gritd.estimator.terramechanics.soil import Array

BAND = 2.0  # [σ] half width of a band


@dataclass(frozen=True)
class Curve:
    """A field drawn as a line; with a field of its standard deviation, in a band of ± 2σ."""

    field: str
    label: str
    style: str  # measured, predicted, estimate, second
    sigma: str = ""


@dataclass(frozen=True)
class Chart:
    """Curves that share an axis. factor: from SI to the unit shown."""

    title: str
    symbol: str
    unit: str
    factor: float
    decimals: int
    curves: tuple[Curve, ...]
    prior: str = ""  # key of the stated prior that is drawn with it
    expected: float | None = None  # where σ is honest


def _estimate(title: str, symbol: str, field: str, unit: str, factor: float, digits: int) -> Chart:
    curve = Curve(field, "estimate", "estimate", f"{field}_sigma")
    return Chart(title, symbol, unit, factor, digits, (curve,), field)


def _beside(title: str, symbol: str, field: str, unit: str, digits: int) -> Chart:
    """Measured against predicted."""
    curves = (
        Curve(field, "measured", "measured"),
        Curve(f"{field}_predicted", "predicted", "predicted", f"{field}_predicted_sigma"),
    )
    return Chart(title, symbol, unit, 1.0, digits, curves)


def _measured(title: str, symbol: str, field: str, unit: str, factor: float, digits: int) -> Chart:
    return Chart(
        title,
        symbol,
        unit,
        factor,
        digits,
        (Curve(field, "measured", "measured", f"{field}_sigma"),),
    )


CHARTS = (
    _estimate("Cohesion", "c", "cohesion", "Pa", 1.0, 0),
    _estimate("Friction", "tan φ", "tan_phi", "", 1.0, 4),
    _estimate("Shear modulus", "k", "shear_modulus", "mm", 1e3, 1),
    _beside("Torque", "T", "torque", "N·m", 3),
    _beside("Drawbar pull", "DP", "drawbar_pull", "N", 2),
    _beside("Load", "W", "load", "N", 2),
    _measured("Slip", "i", "slip", "%", 100.0, 1),
    _measured("Sinkage", "z", "sinkage", "mm", 1e3, 2),
    Chart(
        "Entry and greatest stress",
        "",
        "°",
        degrees(1.0),
        1,
        (
            Curve("theta_1", "θ₁", "measured", "theta_1_sigma"),
            Curve("theta_m", "θₘ", "second"),
        ),
    ),
    Chart(
        "Largest pull on offer",
        "",
        "N",
        1.0,
        2,
        (Curve("drawbar_pull_max", "largest pull", "estimate", "drawbar_pull_max_sigma"),),
    ),
    Chart(
        "Innovations squared, of their variance",
        "",
        "",
        1.0,
        2,
        (Curve("consistency", "mean", "estimate"),),
        expected=1.0,
    ),
)
LATENESS = Chart(
    "Lateness of the loop", "", "ms", 1e3, 2, (Curve("lateness", "wake-up", "measured"),)
)


def fields_of(charts: Iterable[Chart]) -> tuple[str, ...]:
    """The fields that charts are made of, each once."""
    named = (f for c in charts for curve in c.curves for f in (curve.field, curve.sigma) if f)
    return tuple(dict.fromkeys(named))


def layout(charts: Sequence[Chart]) -> list[dict[str, Any]]:
    """What the page is given; its columns are those of `drawn`, in order."""
    return [asdict(chart) for chart in charts]


def drawn(charts: Sequence[Chart], fields: Sequence[str], values: Array) -> Array:
    """Columns of the charts in their units (n, m), from the fields' values (n, len(fields)) in SI:
    of each curve its line, and where it has a band, the band's low and high edge.
    """
    place = {name: at for at, name in enumerate(fields)}
    return np.stack(list(_columns(charts, place, values)), axis=1)


def _columns(charts: Sequence[Chart], place: dict[str, int], values: Array) -> Iterator[Array]:
    for chart in charts:
        for curve in chart.curves:
            line = values[:, place[curve.field]] * chart.factor
            yield line
            if curve.sigma:
                half = BAND * chart.factor * values[:, place[curve.sigma]]
                yield from (line - half, line + half)
