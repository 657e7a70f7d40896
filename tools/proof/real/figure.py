"""One small drawing a proof."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gritd.tools.cli.drawing import AFTER, BEFORE, FINE, INK, look, save
from gritd.tools.proof.real.proof import Panel

WIDE, LEAST, HIGH = 2.9, 5.8, 2.3  # [in] of a panel, of a drawing at least; its height
COLOURS = (INK, BEFORE, AFTER)
MARKS = ("o", "x", "+")


def draw(path: Path, panels: Sequence[Panel]) -> None:
    """Write the panels side by side as PNG."""
    with look():
        size = (max(WIDE * len(panels), LEAST), HIGH)
        figure = Figure(figsize=size, layout="constrained")
        across = figure.subplots(1, len(panels), squeeze=False)[0]
        for ax, panel in zip(across, panels, strict=True):
            _drawn(ax, panel)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        save(figure, path)


def _drawn(ax: Axes, panel: Panel) -> None:
    x, *curves = panel.curves
    for values, label, colour, mark in zip(curves, panel.labels, COLOURS, MARKS, strict=True):
        if panel.points:
            ax.plot(x, values, mark, color=colour, ms=4, mew=1.0, fillstyle="none", label=label)
        else:
            ax.plot(x, values, color=colour, lw=FINE, label=label)

    ax.set_title(panel.title)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
