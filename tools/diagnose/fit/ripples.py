"""Ripples that the recordings show at their own rate, on the values of the grid."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.signatures import highest_order, resolved_order
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.rig.interface import Index, Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


def restored(rig: Rig, channel: str) -> list[SpectralLine]:
    """Lines of a channel that stand on the grid as they are at its times."""
    lines = [line for name in rig.recorded(channel) for line in rig.lines.of(name)]
    return [line for line in lines if line.axis == "angle" and not line.harmonic]


def line_waves(
    stack: Stack, of: Callable[[SpectralLine], bool] = lambda _: True
) -> Iterator[tuple[SpectralLine, Index, Array]]:
    """Lines for which `of` holds: on the values (n,) of each run and channel while the wheel turns,
    cosine and sine (n, 2).
    """
    moving, angle = stack.covariate("speed") > 0.0, stack.covariate("wheel_angle")
    for channel, number in stack.parts:
        index = np.flatnonzero(stack.of(channel) & moving & (stack.run == number))
        for line in restored(stack.rig, channel):
            if index.size and of(line):
                phase = line.at * angle[index]
                yield line, index, np.column_stack((np.cos(phase), np.sin(phase)))


def line_columns(stack: Stack, unheld: bool = False) -> Array:
    """Cosine and sine (N, m) of every such line, of each run its own; unheld: only of those that
    are too fast for the grid.
    """
    columns = [np.zeros((stack.size, 0))]
    for _, index, waves in line_waves(stack, lambda x: not unheld or _too_fast(stack.rig, x)):
        own = np.zeros((stack.size, 2))
        own[index] = waves
        columns.append(own)
    return np.column_stack(columns)


def orders_shown(stack: Stack, lowest: float) -> Array:
    """Ripples a turn (o,) that the grid shows: whole numbers, and those that stand on it as they
    are at its times.
    """
    whole = np.arange(lowest, min(highest_order(stack.rig), TUNING.fit.most_orders))
    if resolved_order(stack.rig) > 1.0:  # less than a turn
        whole = whole[:0]
    lines = (x for channel in stack.rig.channels for x in restored(stack.rig, channel))
    more = [x.at for x in lines if x.at >= lowest]
    return np.unique(np.concatenate((whole, more)))


def _too_fast(rig: Rig, line: SpectralLine) -> bool:
    rate = 1.0 / float(np.median(np.diff(rig.runs[0].time)))
    return line.frequency[1] > TUNING.orders.nyquist * rate
