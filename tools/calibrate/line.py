"""The straight line through readings of known values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import FAILED, CommandError

SCATTER = 3.0  # residuals so many times what is expected, or more, are reported
BEND = 4.0  # [σ] at which a curvature is reported
FLAT = 5.0  # [σ] of the slope, below which the readings do not follow the known values


@dataclass(frozen=True)
class Point:
    """One known value, and what the sensor read at it.

    raw:   the mean of the readings, with its standard deviation.
    known: SI, with the standard deviation of what it was set by.
    notes: what is to be reported of the readings.
    """

    raw: Uncertain
    known: Uncertain
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class CalibrationLine:
    """physical = raw · scale + offset.

    scale:     its sigma is that of the slope; offset: its sigma is that at physical zero.
    residuals: known − line at each point, SI, shape (n,).
    expected:  what noise and the known values explain of a residual, shape (n,).
    """

    points: tuple[Point, ...]
    scale: Uncertain
    offset: Uncertain
    residuals: Array
    expected: Array
    warnings: tuple[str, ...]

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, for the degrees of freedom that are left; 0 of two."""
        freedom = self.residuals.size - 2
        return float(np.sqrt((self.residuals**2).sum() / freedom)) if freedom > 0 else 0.0


def fitted(points: Sequence[Point]) -> CalibrationLine:
    """The line raw = a + b · known by weighted least squares, turned round. Where the residuals are
    larger than expected, all σ are raised by as much. Raises CommandError.
    """
    known = np.array([point.known.value for point in points])
    raw = np.array([point.raw.value for point in points])
    if len(points) < 2 or np.ptp(known) == 0.0:
        raise CommandError(
            f"found {len(points)} points at {np.unique(known).size} known values; "
            "expected two values or more",
            FAILED,
        )

    slope = np.polyfit(known, raw, 1)[0]
    if abs(slope) * np.ptp(known) <= 1e-9 * np.abs(raw).max():
        raise CommandError("the sensor reads the same at every known value", FAILED)
    sigma = np.array([np.hypot(p.raw.sigma, slope * p.known.sigma) for p in points])
    sigma = np.maximum(sigma, 1e-12 * np.abs(raw).max())

    (zero, slope), covariance = _least_squares(known, raw, sigma)
    off = raw - zero - slope * known
    excess = _excess(off / sigma)
    spread = np.sqrt(np.diag(covariance)) * max(excess, 1.0)
    warnings = _warnings(known, raw, sigma, excess)
    if abs(slope) < FLAT * spread[1]:
        warnings.insert(0, "the readings do not follow the known values")

    warnings += dict.fromkeys(note for point in points for note in point.notes)

    return CalibrationLine(
        tuple(points),
        Uncertain(1.0 / slope, float(spread[1]) / slope**2),
        Uncertain(-zero / slope, float(spread[0]) / abs(slope)),
        -off / slope,
        sigma / abs(slope),
        tuple(warnings),
    )


def _least_squares(known: Array, raw: Array, sigma: Array) -> tuple[Array, Array]:
    """Zero and slope (2,), and their covariance (2, 2)."""
    design = np.column_stack([np.ones_like(known), known]) / sigma[:, None]
    covariance: Array = np.linalg.inv(design.T @ design).astype(float)
    return covariance @ design.T @ (raw / sigma), covariance


def _excess(relative: Array) -> float:
    """How many times larger the residuals are than expected; 0 where none are left."""
    freedom = relative.size - 2
    return float(np.sqrt((relative**2).sum() / freedom)) if freedom > 0 else 0.0


def _warnings(known: Array, raw: Array, sigma: Array, excess: float) -> list[str]:
    """What makes the line doubtful."""
    if known.size == 2:
        return ["two points fit every line: a third would show whether it is one"]
    notes = []
    if excess > SCATTER:
        notes.append(f"the residuals are {excess:.1f} times what noise and known values explain")
    if known.size >= 4 and (bend := _bend(known, raw, sigma * max(excess, 1.0))) > BEND:
        notes.append(f"the readings bend away from a line, {bend:.0f} σ")
    return notes


def _bend(known: Array, raw: Array, sigma: Array) -> float:
    """By how many σ a parabola fits better than a line; 0 where fewer than three values differ."""
    if np.unique(known).size < 3:
        return 0.0
    x = (known - known.mean()) / np.ptp(known)
    design = np.column_stack([np.ones_like(x), x, x**2]) / sigma[:, None]
    coefficients, left, *_ = np.linalg.lstsq(design, raw / sigma, rcond=None)
    covariance = np.linalg.inv(design.T @ design)
    freedom = known.size - 3
    least = float(np.sqrt(left[0] / freedom)) if freedom > 0 and left.size else 1.0
    return abs(float(coefficients[2])) / float(np.sqrt(covariance[2, 2])) / max(least, 1e-3)
