"""The line of a calibration as a figure: readings, line, residuals."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gritd.tools.calibrate.line import CalibrationLine
from gritd.tools.calibrate.outcome import CalibrationOutcome
from gritd.tools.cli.command import USAGE, CommandError, os_errors
from gritd.tools.cli.optional import require

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT = 3.2  # [in]


def draw(path: Path, outcome: CalibrationOutcome) -> None:
    """As PNG or SVG. Raises CommandError."""
    require("matplotlib", "--png")
    if not outcome.fits:
        raise CommandError("--png: this calibration has no line to draw", USAGE)
    from matplotlib.figure import Figure

    from gritd.tools.cli.drawing import COLUMN, look, save

    name, line = outcome.fits[0]
    with look():
        figure = Figure(figsize=(COLUMN, HEIGHT), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        _line(above, name, line)
        _residuals(below, line)

        with os_errors(path):
            save(figure, path)


def _line(axes: Axes, name: str, line: CalibrationLine) -> None:
    from gritd.tools.cli.drawing import AFTER, MEASURED, WIDE

    raw = np.array([point.raw.value for point in line.points])
    known = [point.known.value for point in line.points]
    ends = np.array([raw.min(), raw.max()])
    fitted = line.scale.value * ends + line.offset.value
    axes.plot(ends, fitted, color=MEASURED, lw=WIDE, label="fitted line")
    axes.plot(raw, known, "o", ms=4, color=AFTER, label="known values")
    axes.set(title=name, ylabel="known value [SI]")
    axes.legend()


def _residuals(axes: Axes, line: CalibrationLine) -> None:
    """With ± σ as they are expected to be."""
    from gritd.tools.cli.drawing import AFTER, MEASURED, WIDE

    raw = [point.raw.value for point in line.points]
    axes.axhline(0.0, color=MEASURED, lw=WIDE)
    axes.errorbar(raw, line.residuals, yerr=line.expected, fmt="o", ms=4, color=AFTER, capsize=2)
    axes.set(xlabel="reading [raw]", ylabel="residual")
