"""Forces of a campaign against slip at each load, against both forms of the equations: Figs. 7 and
8 of the paper, at the width of a column.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from gritd.tools.cli.drawing import AFTER, COLUMN, FINE, LINE, SOFT, Name, last, look, named, save
from gritd.tools.report.campaign import FORCES, ReportedCampaign, mean_over
from gritd.tools.report.lab import MeasuredWindows, joined

HEIGHT = 2.3  # [in] of a force
PALEST = 0.55  # share of white in the colour of the lightest load
MOST = 300  # dots of a load
KEY = "dots: measured, lines: original equations, dashed: closed form"


def draw(path: Path, campaign: ReportedCampaign) -> None:
    """As PNG or SVG. Raises OSError, and ValueError where the filter was never updated."""
    every = [run.windows for run in campaign.runs if run.windows is not None]
    if not every:
        raise ValueError("found no window at which the filter was updated")
    loads = joined(every).by_load()
    forces = {channel: of for channel, of in FORCES.items() if _measured(loads, channel)}

    with look():
        figure = Figure(figsize=(COLUMN, HEIGHT * len(forces)), layout="constrained")
        axes = figure.subplots(len(forces), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (channel, (label, _)) in zip(axes, forces.items(), strict=True):
            _force(ax, loads, channel)
            ax.set_ylabel(label)

        axes[0].set_title(KEY, color=SOFT, fontweight="normal", fontsize=7)
        axes[-1].set_xlabel("slip [%]")
        save(figure, path)


def _measured(loads: Sequence[MeasuredWindows], channel: str) -> bool:
    return any(np.isfinite(load.measured[channel]).any() for load in loads)


def _force(ax: Axes, loads: Sequence[MeasuredWindows], channel: str) -> None:
    """Each load in a shade of its own, the heaviest the darkest."""
    names = []
    for at, load in enumerate(loads):
        white = PALEST * (len(loads) - 1 - at) / max(len(loads) - 1, 1)
        colour = shade(AFTER, white)
        some = slice(None, None, -(-len(load.slip) // MOST))
        slip = 100.0 * load.slip

        ax.plot(slip[some], load.measured[channel][some], ".", ms=2.5, color=colour, alpha=0.5)
        x, original = mean_over(slip, load.original[channel])
        ax.plot(x, original, color=colour, lw=LINE)
        ax.plot(*mean_over(slip, load.closed[channel]), color=colour, lw=FINE, ls=(0, (4, 2)))
        names.append(Name(last(original), f"{np.mean(load.load):.0f} N", colour))
    named(ax, names)


def shade(colour: str, white: float) -> str:
    """A colour with a share of white."""
    red, green, blue = (part + white * (1.0 - part) for part in to_rgb(colour))
    return to_hex((red, green, blue))
