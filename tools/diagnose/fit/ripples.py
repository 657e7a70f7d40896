"""Ripples that the recordings show at their own rate, on the values of the grid."""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.signatures import highest_order
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


def restored(rig: Rig, channel: str) -> list[SpectralLine]:
    """Lines of a channel that stand on the grid as they are at its times."""
    lines = [line for name in rig.recorded(channel) for line in rig.lines.of(name)]
    return [line for line in lines if line.axis == "angle" and not line.harmonic]


def line_columns(stack: Stack, unheld: bool = False) -> Array:
    """Cosine and sine (N, m) of every such line, of each run its own; unheld: only of those that
    are too fast for the grid.
    """
    moving, angle = stack.covariate("speed") > 0.0, stack.covariate("wheel_angle")
    columns = [np.zeros((stack.size, 0))]

    for channel in stack.rig.channels:
        own = stack.of(channel) & moving
        for line in restored(stack.rig, channel):
            if unheld and not _too_fast(stack.rig, line):
                continue
            phase = line.at * angle
            for number in np.unique(stack.run[own]):
                here = own & (stack.run == number)
                waves = np.column_stack((np.cos(phase), np.sin(phase)))
                columns.append(np.where(here[:, None], waves, 0.0))

    return np.column_stack(columns)


def orders_shown(stack: Stack, lowest: float) -> Array:
    """Ripples a turn (o,) that the grid shows: whole numbers, and those that stand on it as they
    are at its times.
    """
    whole = np.arange(lowest, highest_order(stack))
    lines = (x for channel in stack.rig.channels for x in restored(stack.rig, channel))
    more = [x.at for x in lines if x.at >= lowest]
    return np.unique(np.concatenate((whole, more)))


def _too_fast(rig: Rig, line: SpectralLine) -> bool:
    rate = 1.0 / float(np.median(np.diff(rig.runs[0].time)))
    return line.frequency[1] > TUNING.fit.order_nyquist * rate
