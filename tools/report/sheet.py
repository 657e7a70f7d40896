"""A comparison on one sheet: a column a run, a row a channel with its residual below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.tools.cli.drawing import (
    AFTER,
    BEFORE,
    FINE,
    MEASURED,
    SOFT,
    WIDE,
    Name,
    last,
    look,
    named,
    noise,
    save,
)
from gritd.tools.cli.wording import number, shown
from gritd.tools.diagnose.explain.result import Trace
from gritd.tools.report import figures
from gritd.tools.report.comparison import Comparison
from gritd.tools.report.words import name_of

ACROSS = 4  # runs side by side
COLUMN, ROW = 3.2, 1.8  # [in] of one run, of one channel


def draw(path: Path, comparison: Comparison) -> None:
    """As PNG or SVG. Raises OSError."""
    runs = comparison.runs
    down = -(-len(runs) // ACROSS)
    across = -(-len(runs) // down)

    with look():
        _drawn(path, comparison, across, down)


def _drawn(path: Path, comparison: Comparison, across: int, down: int) -> None:
    runs, channels = comparison.runs, comparison.channels
    size = (COLUMN * max(across, 2), ROW * len(channels) * down + 0.5)
    figure = Figure(figsize=size, layout="constrained")
    blocks = figure.subfigures(down, across, squeeze=False).flat

    for block, run in zip(blocks, runs, strict=False):
        heights = [3.0, 1.2] * len(channels)
        axes = block.subplots(
            2 * len(channels), 1, sharex=True, gridspec_kw={"height_ratios": heights}, squeeze=False
        )
        block.suptitle(_plain_text(run), fontsize=9)
        for at, channel in enumerate(channels):
            trace = next(t for t in comparison.traces if (t.run, t.channel) == (run, channel))
            _trace(axes[2 * at, 0], axes[2 * at + 1, 0], trace)
        axes[-1, 0].set_xlabel("time [s]")

    save(figure, path)


def _plain_text(name: str) -> str:
    """A run's name without what matplotlib would read as mathematics, and short enough for its
    column.
    """
    name = "".join(c if c.isprintable() else "\ufffd" for c in name).replace("$", r"\$")
    return name if len(name) <= 48 else f"{name[:47]}…"


def _trace(signal: Axes, residual: Axes, trace: Trace) -> None:
    unit, factor = shown(trace.unit)
    used = np.asarray(trace.used, bool)
    time = np.asarray(trace.time) - trace.time[0]
    measured = np.asarray(trace.measured, float) * factor
    signal.plot(time, measured, color=MEASURED, lw=WIDE)
    names = [Name(last(measured), "recorded", MEASURED)]

    for label, which, colour in _sides(trace):
        simulated = np.where(used, np.asarray(getattr(trace, which), float) * factor, np.nan)
        signal.plot(time, simulated, color=colour)
        residual.plot(time, measured - simulated, color=colour, lw=FINE)
        names.append(Name(last(simulated), label, colour))

    noise(residual, trace.sigma * factor)
    signal.set_ylabel(f"{name_of(trace.channel)} [{unit}]")
    residual.set_ylabel("residual")
    signal.margins(x=0.0)
    named(signal, names, 0.14)

    errors = " → ".join(
        number(figures.rms(trace, which) * factor, 2) for _, which, _ in _sides(trace)
    )
    residual.set_title(f"rms {errors} {unit}", fontweight="normal", color=SOFT, pad=2)


def _sides(trace: Trace) -> Sequence[tuple[str, str, str]]:
    configured = ("configured", "before", BEFORE)
    return (
        (configured, ("soil fitted", "after", AFTER)) if figures.differs(trace) else (configured,)
    )
