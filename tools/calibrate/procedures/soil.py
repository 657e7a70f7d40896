"""Plates pressed into the soil: exponent and moduli of σ = (k_c/b + k_φ) zⁿ with their scatter.

b of a round plate is its radius. Each test is fitted by Wong's weighting, which minimises
Σ p² (ln p − ln K − n ln z)²: large pressures count, as they do under a wheel. The scatter is that
between tests, since the next bed is as different as they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.calibrate import spikes
from gritd.tools.calibrate.outcome import CalibratedKey, CalibrationOutcome
from gritd.tools.cli.command import DAMAGED, FAILED, CommandError, os_errors

SUMMARY = "plate tests: sinkage exponent and moduli with their scatter, into the soil's prior"
DIAMETER = re.compile(r"plate\s*diameter\s*:?\s*([\d.]+)\s*(mm|cm|m)\b", re.IGNORECASE)
PAIR = re.compile(r"\s*(-?\d+\.?\d*)\s*[,;\t]\s*(-?\d+\.?\d*)\s*$")
METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
SHALLOW = 2e-3  # [m] a plate has not met the soil with all of its face before
BEFORE = 5e-3  # [m] that a plate may have sunk in before its force is distinguished from zero
FEWEST = 8  # points of a test
SURE = 2.0  # [σ] from which k_c is distinguished from 0
UNLIKE = 1.5  # the largest plate over the smallest, from which they may tell k_c: a wheel is wider
NO_PRESS = (
    "found no press; expected the load to rise from below {:g} N, the plate in the air, to its "
    "largest value"
)
EXPONENTS = (0.1, 3.0)  # between which a soil's exponent lies


@dataclass(frozen=True)
class Press:
    """One plate test: radius of the plate [m], depth [m] and pressure [Pa] while loading, (n,)."""

    name: str
    radius: float
    depth: Array
    pressure: Array


def read(path: Path) -> Press:
    """A text file with `Plate Diameter: 4.50cm`, then pairs of force [N] and sinkage [mm]. Raises
    CommandError.
    """
    with os_errors(path):
        text = path.read_text(encoding="utf-8", errors="replace")

    diameter = DIAMETER.search(text)
    if diameter is None:
        raise CommandError(
            f"{path}: found no plate diameter; expected a line such as 'Plate Diameter: 4.50cm'",
            DAMAGED,
        )

    pairs = [m.groups() for line in text[diameter.end() :].splitlines() if (m := PAIR.match(line))]
    rows = np.array(pairs, dtype=float).reshape(-1, 2)
    return of_rows(path.name, float(diameter[1]) * METRES[diameter[2].lower()] / 2, rows)


def of_rows(name: str, radius: float, rows: Array) -> Press:
    """Rows of force [N] and sinkage [mm], (n, 2), up to the largest force. Raises CommandError."""
    rows = rows[: int(np.argmax(rows[:, 0])) + 1] if rows.size else rows
    depth, pressure = rows[:, 1] * 1e-3, rows[:, 0] / (np.pi * radius**2)

    used = (depth > SHALLOW) & (pressure > 0.0)
    if used.sum() < FEWEST:
        raise CommandError(
            f"{name}: found {used.sum()} points deeper than {1e3 * SHALLOW:g} mm; "
            f"expected {FEWEST} or more",
            DAMAGED,
        )

    return Press(name, radius, depth[used], pressure[used])


def of_press(name: str, radius: float, force: Array, depth: Array, contact: float) -> Press:
    """Force [N] and depth [m] of one press, (n,), in the order of time, up to the largest force.
    Depth counts from the surface, which the plate meets a little before the force rises above
    `contact` [N]; where the force never was below, as it is written. Raises CommandError.
    """
    far = spikes.spikes(force) | spikes.spikes(depth)
    spikes.note(far, "plate", f"{name}: ")
    force, depth = force[~far], depth[~far]

    hanging = np.flatnonzero(force < contact)
    first = int(hanging[0]) if hanging.size else 0
    last = first + int(np.argmax(force[first:])) if force.size else 0
    if not force.size or force[last] < contact:
        raise CommandError(f"{name}: {NO_PRESS.format(contact)}", DAMAGED)

    free = hanging[hanging < last]
    begin = int(free[-1]) if free.size else 0
    force, depth = force[begin : last + 1], depth[begin : last + 1]
    zero = _surface(force, depth) if free.size else 0.0
    return of_rows(name, radius, np.column_stack([force, 1e3 * (depth - zero)]))


def _surface(force: Array, depth: Array) -> float:
    """The depth [m] from which a power law fits best, up to BEFORE above the first reading."""
    used = (depth > depth[0] + SHALLOW) & (force > 0.0)
    if used.sum() < FEWEST:
        return float(depth[0])
    force, depth, first = force[used], depth[used], float(depth[0])

    def misfit(zero: float) -> float:
        design = np.column_stack([np.ones_like(depth), np.log(depth - zero)]) * force[:, None]
        seen = force * np.log(force)
        found = np.linalg.lstsq(design, seen, rcond=None)[0]
        return float(((seen - design @ found) ** 2).sum())

    return float(minimize_scalar(misfit, bounds=(first - BEFORE, first), method="bounded").x)


def exponent(press: Press) -> float:
    """n of one test."""
    weight, x = press.pressure, np.log(press.depth)
    design = np.column_stack([np.ones_like(x), x]) * weight[:, None]
    coefficients = np.linalg.lstsq(design, weight * np.log(press.pressure), rcond=None)[0]
    return float(coefficients[1])


def modulus(press: Press, n: float) -> float:
    """K of one test at a given exponent."""
    weight = press.pressure**2
    logs = np.log(press.pressure) - n * np.log(press.depth)
    return float(np.exp(np.average(logs, weights=weight)))


def outcome(tests: Sequence[Press], settings: Settings) -> CalibrationOutcome:
    """Exponent and moduli of all tests. Raises CommandError."""
    each = np.array([exponent(test) for test in tests])
    good = [t for t, n in zip(tests, each, strict=True) if EXPONENTS[0] <= n <= EXPONENTS[1]]
    each = each[(each >= EXPONENTS[0]) & (each <= EXPONENTS[1])]
    if len(good) < 3:
        raise CommandError(
            f"found {len(good)} tests that a power law fits; expected three or more", FAILED
        )

    n = Uncertain(float(each.mean()), float(each.std(ddof=1) * np.sqrt(1.0 + 1.0 / each.size)))
    moduli = np.array([modulus(test, n.value) for test in good])
    width = settings.wheel.width
    k_c, k_phi, sigma, warnings = _moduli(np.array([t.radius for t in good]), moduli, width)
    if len(good) < len(tests):
        warnings.append(f"{len(tests) - len(good)} tests are left out: no power law fits them")

    at_width = k_c / width + k_phi
    values = (
        CalibratedKey(("soil", "exponent"), n, ""),
        CalibratedKey(("soil", "k_c"), _rounded(k_c, 4), "Pa/m^(n-1)", "kN/m^(n+1)"),
        CalibratedKey(("soil", "k_phi"), _rounded(k_phi, 4), "Pa/m^n", "kN/m^(n+2)"),
        CalibratedKey(("soil", "modulus_sigma"), _rounded(min(sigma / at_width, 1.0), 2), "", "%"),
    )
    return CalibrationOutcome(
        values, lines=tuple(_rows(good, moduli, each)), warnings=tuple(warnings)
    )


def _moduli(radius: Array, moduli: Array, width: float) -> tuple[float, float, float, list[str]]:
    """k_c, k_φ, standard deviation of K under a wheel of `width` in the next bed, and warnings.

    k_c is 0 where the plates do not tell it from 0.
    """
    mean, scatter = float(moduli.mean()), float(moduli.std(ddof=1))
    alone = scatter * float(np.sqrt(1.0 + 1.0 / moduli.size))
    sizes = np.unique(radius.round(5))
    if sizes[-1] < UNLIKE * sizes[0]:
        return 0.0, mean, alone, [_undetermined(sizes, "are too alike to tell k_c")]

    design = np.column_stack([1.0 / radius, np.ones_like(radius)])
    coefficients, *_ = np.linalg.lstsq(design, moduli, rcond=None)
    left = moduli - design @ coefficients
    variance = float((left**2).sum() / max(moduli.size - 2, 1))
    covariance = variance * np.linalg.inv(design.T @ design)
    at = np.array([1.0 / width, 1.0])

    distinct = (
        abs(coefficients[0]) > SURE * float(np.sqrt(covariance[0, 0])) and at @ coefficients > 0.0
    )
    if not distinct:
        return 0.0, mean, alone, [_undetermined(sizes, "do not tell k_c from 0")]
    spread = float(np.sqrt(variance + at @ covariance @ at))
    return float(coefficients[0]), float(coefficients[1]), spread, []


def _rounded(value: float, digits: int) -> Uncertain:
    """To so many digits: modulus_sigma says how uncertain the moduli are."""
    return Uncertain(float(f"{value:.{digits}g}"))


def _undetermined(sizes: Array, why: str) -> str:
    diameters = ", ".join(f"{2e3 * size:g}" for size in sizes.tolist())
    return f"plates of {diameters} mm {why}; it is written as 0"


def _rows(tests: Sequence[Press], moduli: Array, each: Array) -> Iterable[str]:
    """By plate: number of tests, exponent and modulus with their scatter."""
    for size in sorted({round(test.radius, 5) for test in tests}):
        chosen = np.array([abs(test.radius - size) < 1e-5 for test in tests])
        n, k = each[chosen], moduli[chosen] / 1e3
        spread = (n.std(ddof=1), k.std(ddof=1)) if n.size > 1 else (0.0, 0.0)
        yield (
            f"plate {2e3 * size:g} mm: {n.size} tests, n {n.mean():.3f} ± {spread[0]:.3f}, "
            f"K {k.mean():.4g} ± {spread[1]:.2g} kPa/m^n"
        )
