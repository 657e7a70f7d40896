"""Tuned numbers of tools/diagnose/noise: size and colour of the noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned

SLOW = (0.02, 0.06, 0.15, 0.3, 0.5, 0.75, 0.95, 0.99)
CELLS = {"slip": 0.04, "speed": 0.08, "load": 0.05}


@dataclass(frozen=True)
class NoiseTuning:
    """What counts as noise in the recordings."""

    # --- blur.py ---
    bend: float = tuned(
        0.5, "-", "share of the bend between neighbours: speeds are slopes over three intervals"
    )
    shallow: float = tuned(0.0005, "m", "a sinkage below which its changes mean little")
    lag: float = tuned(
        0.015, "s", "an axle sinks later than in the balance: its damping carries load meanwhile"
    )
    taken_up: float = tuned(
        0.3, "-", "of the axle's torque: open after a reversal, which falls inside an interval"
    )

    # --- colour.py ---
    fast_time: float = tuned(1.5, "intervals", "correlation time of the fast part")

    # --- estimate.py ---
    slow_times: tuple[float, ...] = tuned(
        (0.5, 1.0, 2.0, 4.0, 10.0), "s", "correlation times of the slow part that are tried"
    )
    slow_shares: tuple[float, ...] = tuned(
        SLOW, "share", "of the variance that the slow part takes, as tried"
    )
    fast_shares: tuple[float, ...] = tuned(
        (0.0, 0.4, 0.9), "share", "of the rest that the fast part takes, as tried"
    )
    steady: float = tuned(
        1.3, "-", "values that blur makes noisier than so many of their channel's σ say nothing"
    )
    careful: float = tuned(
        0.6, "quantile", "of slow power in its posterior that the whitening assumes"
    )
    slow_power: float = tuned(
        0.5, "-", "power of slow power by which a colour is rarer: instruments hiss more than drift"
    )
    spike: float = tuned(
        6.0, "σ", "from the median of its neighbours: such a value counts as much less certain"
    )
    spike_neighbours: int = tuned(5, "values", "whose median tells a spike")
    restless: float = tuned(
        1.5, "-", "times the noise's differences from value to value: the noise is larger there"
    )
    least_noise: float = tuned(
        0.05, "share", "of the noise: so much differs from value to value, and an idle motor has"
    )
    floor: float = tuned(
        1e-5, "-", "of a channel's size: no noise is below it, simulations need a scale"
    )

    # --- lines.py ---
    stretch: float = tuned(40.0, "s", "for which a wave keeps its phase at least")
    line_density: float = tuned(
        2.0, "-", "frequencies tried in each that the longest stretch resolves"
    )
    most_frequencies: int = tuned(200, "frequencies", "of a scan, at most", "run time")

    # --- replicates.py ---
    cell_widths: Mapping[str, float] = tuned(
        CELLS, "-", "of a cell of equal conditions; of speed and load relative to their largest"
    )
    cell_values: int = tuned(10, "values", "a cell must hold, and either side of a step")
    most_cells: int = tuned(60, "cells", "of a channel, or loads, at most")
    cell_phases: tuple[float, ...] = tuned(
        (0.5, 0.75, 0.0, 0.25), "choice", "of the edges of cells, in their widths"
    )
    least_pairs: int = tuned(2, "comparisons", "of replicates at least")
    drift_shapes: int = tuned(4, "shapes", "of what a run does: a mean and three of drift")
    mostly: float = tuned(0.9, "share", "of a run in one cell: it held one condition")

    # --- saturated.py ---
    saturated_columns: int = tuned(40, "columns", "of the saturated mean, at most")
    values_per_column: int = tuned(4, "values", "at least, for each column of it")
    slight_column: float = tuned(
        1e-4, "-", "of the residual: what changes less at its expected size is a solver's rounding"
    )
