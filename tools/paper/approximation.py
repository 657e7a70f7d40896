"""How far the linear model is from the original: Table 3, and simulations over random soils.

The paper prints percentages without saying how they are formed, and its Tables 2 and 3 could not be
had. So every comparison names the soil and the definition it used, and several definitions stand
side by side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gritd.estimator.model import balance
from gritd.estimator.stages.situation import ContactLaw
from gritd.estimator.terramechanics import linear, original
from gritd.estimator.terramechanics.original import arc, front_stress
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.estimator.terramechanics.soils import LOOSE_SAND, MARS_LIKE, TABLE_1
from gritd.tools.paper.closed_forms import WHEEL, Lines

# What the simulations draw from: the box around Table 1 in place of Table 2, which could not be
# had.
RANGES = {
    "exponent": (0.5, 1.6),
    "k_c": (0.9e3, 13.2e3),  # [Pa/m^(n−1)]
    "k_phi": (196.7e3, 1523.4e3),  # [Pa/mⁿ]
    "cohesion": (1.0e3, 4.14e3),  # [Pa]
    "friction_angle": (13.0, 30.0),  # [degrees]
    "shear_modulus": (0.010, 0.040),  # [m]
    "slip": (0.05, 0.90),
    "theta_1": (10.0, 60.0),  # [degrees]
    "load": (10.0, 100.0),  # [N]
}


# How a percentage may be formed from closed form and original.
DEFINITIONS: dict[str, Callable[[Array, Array], float]] = {
    "mean |Δ|/|o|": lambda ours, original: float(
        100 * np.mean(np.abs((ours - original) / original))
    ),
    "median |Δ|/|o|": lambda ours, original: float(
        100 * np.median(np.abs((ours - original) / original))
    ),
    "Σ|Δ|/Σ|o|": lambda ours, original: float(
        100 * np.sum(np.abs(ours - original)) / np.sum(np.abs(original))
    ),
    "rms Δ/rms o": lambda ours, original: float(
        100 * np.linalg.norm(ours - original) / np.linalg.norm(original)
    ),
}


def table_3() -> Lines:
    """Closed form against original over θ₁ and slip, for each soil."""
    yield (
        "Table 3: closed form against original, θ₁ 10-60°, θₘ = θ₁/2, slip 5-80 %. Paper: "
        "2.0 % (DP), 2.6 % (T)"
    )
    yield (
        "  The printed table could not be had. Soils of Table 1, "
        "and two stand-ins for its low-cohesion soils."
    )
    yield _header("soil")

    angles, slips = np.radians(np.linspace(10, 60, 51)), np.linspace(0.05, 0.8, 16)
    theta_1, slip = (grid.ravel() for grid in np.meshgrid(angles, slips))
    rows: list[ComparisonRow] = []
    for named in (*TABLE_1, LOOSE_SAND, MARS_LIKE):
        rows += compare(named.name, named.under(WHEEL.width), theta_1, slip)

    yield from map(_row, rows)
    yield "  o is the original; DP passes through zero, where |Δ|/|o| means little."
    yield f"  {nearest(rows, 2.0, 2.6)}\n"


def simulations(count: int, seed: int) -> Lines:
    """Closed form against original over random soils."""
    soil, slip, theta_1, load = draw(count, seed)
    yield (
        f"{count} simulations. Paper: 9.34 % and 12.15 %; "
        "neither the percentage nor θ₁ is defined there"
    )
    yield (
        "  Table 2 could not be had: soils uniform in the box around Table 1; slip 5-90 %, "
        "r 72 mm, b 71 mm."
    )
    yield _header("θ₁")

    rows = compare("10-60°", soil, theta_1, slip)
    yield from map(_row, rows)
    yield f"  … solving the vertical balance (9) of {count} wheels"

    solved = balance.solve(WHEEL, balance.Contact(soil, ContactLaw(0.5), slip, load))
    carried = np.logical_not(solved.overloaded)
    kept = Soil(**{name: values[carried] for name, values in vars(soil).items()})
    carrying = compare("of W 10-100 N", kept, solved.theta_1[carried], slip[carried])
    yield from map(_row, carrying)

    yield (
        f"  {count - np.count_nonzero(carried)} wheels sank to the axle and are left out of the "
        "last two rows."
    )
    yield f"  {nearest(rows + carrying, 9.34, 12.15)}\n"


def draw(count: int, seed: int) -> tuple[Soil, Array, Array, Array]:
    """Soils, slip, θ₁ [rad] and load [N], uniform in RANGES; all arrays (count,)."""
    rng = np.random.default_rng(seed)
    value = {name: rng.uniform(low, high, count) for name, (low, high) in RANGES.items()}
    modulus = value["k_c"] / WHEEL.width + value["k_phi"]
    tan_phi = np.tan(np.radians(value["friction_angle"]))
    soil = Soil(value["cohesion"], tan_phi, value["shear_modulus"], value["exponent"], modulus)
    return soil, value["slip"], np.radians(value["theta_1"]), value["load"]


class ComparisonRow(NamedTuple):
    """One way of comparing: what, where σₘ is from, and (DP, T) in percent by each definition."""

    label: str
    source: str
    percent: dict[str, tuple[float, float]]


def compare(label: str, soil: Soil, theta_1: Array, slip: Array) -> list[ComparisonRow]:
    """Closed forms with σₘ from W by (21), and with σₘ of (3) at θₘ, against the original's DP and
    T. θ₁ [rad] and slip (n,).
    """
    exact = original.forces(WHEEL, soil, theta_1, slip)
    state = (soil.cohesion, soil.tan_phi, soil.shear_modulus, theta_1, slip)
    peak = front_stress(WHEEL, soil, arc(theta_1, original.theta_m(WHEEL, slip, theta_1)))

    closed = {
        "of (21)": linear.forces_under_load(WHEEL, *state, exact.load, linear.ARRAYS),
        "of (3)": linear.forces(WHEEL, *state, peak, linear.ARRAYS),
    }
    return [
        ComparisonRow(label, source, deviations(forces, exact)) for source, forces in closed.items()
    ]


def deviations(
    closed: linear.LinearForces, exact: original.OriginalForces
) -> dict[str, tuple[float, float]]:
    """(DP, T) in percent, by each definition."""
    return {
        name: (define(closed.drawbar_pull, exact.drawbar_pull), define(closed.torque, exact.torque))
        for name, define in DEFINITIONS.items()
    }


def nearest(rows: list[ComparisonRow], drawbar_pull: float, torque: float) -> str:
    """The pair that comes closest to the printed one."""

    def distance(pair: tuple[float, float]) -> float:
        return abs(math.log(pair[0] / drawbar_pull)) + abs(math.log(pair[1] / torque))

    row, name = min(
        ((row, name) for row in rows for name in row.percent),
        key=lambda at: distance(at[0].percent[at[1]]),
    )
    ours = row.percent[name]
    return (
        f"Nearest: {ours[0]:.2f} % and {ours[1]:.2f} % ({row.label}, σₘ {row.source}, {name}); "
        "no match is claimed."
    )


def _row(row: ComparisonRow) -> str:
    cells = "".join(f"{pull:>8.2f}{torque:>8.2f}" for pull, torque in row.percent.values())
    return f"  {row.label:<14}{row.source:<9}{cells}"


def _header(label: str) -> str:
    names = "".join(f"{name:>16}" for name in DEFINITIONS)
    units = "".join(f"{'DP %':>8}{'T %':>8}" for _ in DEFINITIONS)
    return f"  {label:<14}{'σₘ':<9}{names}\n  {'':<23}{units}"
