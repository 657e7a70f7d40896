"""One small drawing a proof."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.tools.proof.real.proof import Panel
from gritd.tools.report.figure import plain

WIDE, LEAST, HIGH, DPI = 4.2, 8.4, 2.9, 80  # [in] of a panel, of a drawing at least; [1/in]
COLOURS = ("#111111", "#c1121f", "#00798c")
MARKS = ("o", "x", "+")


def draw(path: Path, panels: Sequence[Panel]) -> None:
    """Write the panels side by side as PNG."""
    figure = Figure(figsize=(max(WIDE * len(panels), LEAST), HIGH), dpi=DPI, layout="constrained")
    for ax, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        _drawn(ax, panel)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.savefig(path)


def _drawn(ax: Axes, panel: Panel) -> None:
    x, *curves = panel.curves
    for values, label, colour, mark in zip(curves, panel.labels, COLOURS, MARKS, strict=True):
        if panel.points:
            ax.plot(x, values, mark, color=colour, ms=6, mew=1.4, fillstyle="none", label=label)
        else:
            ax.plot(x, values, color=colour, lw=1.0, label=label)

    ax.set_title(panel.title, fontsize=9)
    ax.set_xlabel(panel.x_label, fontsize=8)
    ax.set_ylabel(panel.y_label, fontsize=8)
    ax.tick_params(labelsize=8)
    plain(ax)
