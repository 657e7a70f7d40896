"""Whole turns of the wheel by hand, or known lengths of rail: what one count is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gritd.estimator.config.settings import Uncertain
from gritd.tools.calibrate.line import Point, fitted
from gritd.tools.calibrate.outcome import CalibrationOutcome
from gritd.tools.calibrate.sources import CalibrationSource, Signal
from gritd.tools.calibrate.straight import Straight

SUMMARY = "turns of the wheel by hand, or lengths of rail: the angle of a count"
ROUNDING = 12.0**-0.5  # [count] standard deviation of what is rounded to whole counts
WHEEL = Straight(
    Signal("wheel_encoder", "count", "count"),
    ("channels", "wheel_encoder"),
    "rad",
    "rad/count",
    "deg",
    offset=False,
)
CARRIAGE = Straight(
    Signal("carriage_encoder", "count", "count"),
    ("channels", "carriage_encoder"),
    "m",
    "rad/count",
    "mm",
    offset=False,
)


def outcome(
    procedure: Straight,
    source: CalibrationSource,
    known: Sequence[Uncertain],
    pulley_radius: float = 1.0,
) -> CalibrationOutcome:
    """`known` in rad, or in m of rail, which the pulley's radius [m] makes an angle. Raises
    CommandError.
    """
    points = [_rounded(point) for point in source.points(procedure.signal, known)]
    fit = procedure.of_line(fitted(points), 1.0 / pulley_radius)
    scale = replace(fit.values[0], shown="mrad/count")
    return replace(fit, values=(scale, *fit.values[1:]))


def _rounded(point: Point) -> Point:
    """An encoder at rest does not scatter, but rounds."""
    return replace(point, raw=Uncertain(point.raw.value, max(point.raw.sigma, ROUNDING)))
