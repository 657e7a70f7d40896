"""A comparison on one sheet, as PNG: a column a run, a row a channel with its residual below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.tools.cli.wording import number, shown
from gritd.tools.diagnose.explain.result import Trace
from gritd.tools.report import figures
from gritd.tools.report.comparison import Comparison
from gritd.tools.report.figure import DPI, ESTIMATE, IDLE, MEASURED, PREDICTED, plain
from gritd.tools.report.words import name_of

ACROSS = 4  # runs side by side
COLUMN, ROW = 4.8, 2.6  # [in] of one run, of one channel


def draw(path: Path, comparison: Comparison) -> None:
    """Raises OSError."""
    runs, channels = comparison.runs, comparison.channels
    down = -(-len(runs) // ACROSS)
    across = -(-len(runs) // down)

    figure = Figure(
        figsize=(COLUMN * max(across, 2), ROW * len(channels) * down + 0.8),
        dpi=DPI,
        layout="constrained",
    )
    blocks = figure.subfigures(down, across, squeeze=False).flat

    for number_of, (block, run) in enumerate(zip(blocks, runs, strict=False)):
        heights = [3.0, 1.2] * len(channels)
        axes = block.subplots(
            2 * len(channels), 1, sharex=True, gridspec_kw={"height_ratios": heights}, squeeze=False
        )
        block.suptitle(_plain_text(run), fontsize=11)
        for at, channel in enumerate(channels):
            trace = next(t for t in comparison.traces if (t.run, t.channel) == (run, channel))
            _trace(axes[2 * at, 0], axes[2 * at + 1, 0], trace, legend=number_of == at == 0)
        axes[-1, 0].set_xlabel("time [s]")

    figure.savefig(path, format="png")


def _plain_text(name: str) -> str:
    """A run's name without what matplotlib would read as mathematics, and short enough for its
    column.
    """
    name = "".join(c if c.isprintable() else "\ufffd" for c in name).replace("$", r"\$")
    return name if len(name) <= 48 else f"{name[:47]}…"


def _trace(signal: Axes, residual: Axes, trace: Trace, legend: bool) -> None:
    unit, factor = shown(trace.unit)
    used = np.asarray(trace.used, bool)
    time = np.asarray(trace.time) - trace.time[0]
    measured = np.asarray(trace.measured, float) * factor
    signal.plot(time, measured, color=MEASURED, lw=3.0, label="recorded")

    for label, which, color in _sides(trace):
        simulated = np.where(used, np.asarray(getattr(trace, which), float) * factor, np.nan)
        signal.plot(time, simulated, color=color, lw=1.2, label=label)
        residual.plot(time, measured - simulated, color=color, lw=0.9)

    residual.axhspan(
        -2 * trace.sigma * factor, 2 * trace.sigma * factor, color=IDLE, lw=0, zorder=0
    )

    signal.set_ylabel(f"{name_of(trace.channel)} [{unit}]", fontsize=9)
    residual.set_ylabel("residual", fontsize=9)
    for ax in (signal, residual):
        plain(ax)
        ax.tick_params(labelsize=8)

    errors = " → ".join(
        number(figures.rms(trace, which) * factor, 2) for _, which, _ in _sides(trace)
    )
    residual.set_title(f"rms {errors} {unit}", loc="left", fontsize=8, pad=2)
    if legend:
        signal.legend(loc="best", fontsize=8, frameon=False)


def _sides(trace: Trace) -> Sequence[tuple[str, str, str]]:
    configured = ("simulated as configured", "before", PREDICTED)
    return (
        (configured, ("simulated, soil fitted", "after", ESTIMATE))
        if figures.differs(trace)
        else (configured,)
    )
