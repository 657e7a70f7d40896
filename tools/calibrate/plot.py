"""The lines of a calibration as a PNG: readings, line, residuals."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.calibrate.line import Line
from gritd.tools.calibrate.outcome import Outcome
from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.cli.optional import require


def draw(path: Path, outcome: Outcome) -> None:
    """Raises CommandError."""
    require("matplotlib", "--png")
    if not outcome.fits:
        raise CommandError("--png: this calibration has no line to draw", USAGE)

    figure = import_module("matplotlib.figure").Figure(figsize=(7.0, 5.0), layout="constrained")
    name, line = outcome.fits[0]
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    _line(above, name, line)
    _residuals(below, line)

    try:
        figure.savefig(path, dpi=120)
    except OSError as error:
        raise CommandError(f"{path}: {(error.strerror or 'cannot write').lower()}", USAGE) from None


def _line(axes: Any, name: str, line: Line) -> None:
    raw = np.array([point.raw.value for point in line.points])
    known = [point.known.value for point in line.points]
    ends = np.array([raw.min(), raw.max()])
    axes.plot(ends, line.scale.value * ends + line.offset.value, color="0.6", label="fitted line")
    axes.plot(raw, known, "o", color="C0", label="known values")
    axes.set(title=name, ylabel="known value [SI]")
    axes.legend(frameon=False)


def _residuals(axes: Any, line: Line) -> None:
    raw = [point.raw.value for point in line.points]
    axes.axhline(0.0, color="0.6")
    axes.errorbar(raw, line.residuals, yerr=line.expected, fmt="o", color="C0", capsize=3)
    axes.set(xlabel="reading [raw]", ylabel="residual")
