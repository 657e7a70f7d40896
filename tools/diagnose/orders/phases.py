"""The angle at which the encoder of each run begins, found by a ripple of the wheel.

An incremental encoder counts from where it was switched on. Runs of another day then ripple with
another phase, though gear or lugs are the same. The phases of one sure ripple tell the difference,
up to a whole tooth or lug.
"""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.campaigns import Lines
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.tuning import TUNING


def guide(lines: Lines) -> SpectralLine | None:
    """The ripple by which the runs of the new campaign are aligned; None where they are already, or
    where one speed alone cannot tell it from a vibration.
    """
    sure = [line for line in lines.fresh() if line.p < TUNING.screen.line]
    ripples = [x for x in sure if x.frequency[1] > TUNING.orders.two_speeds * x.frequency[0]]
    if not ripples:
        return None
    best = max(ripples, key=lambda line: (line.support, -line.p))
    apart = [abs(turn) for turn in _turns(best)]
    return best if max(apart, default=0.0) > TUNING.orders.out_of_step else None


def shifts(line: SpectralLine) -> Array:
    """To be added to the wheel's angle of each run (r,) [rad]; 0 where the run does not tell."""
    return np.array(_turns(line)) / line.at


def _turns(line: SpectralLine) -> list[float]:
    """By what the ripple of each run is behind that of the surest one [rad of the ripple]."""
    surest = max((a for a in line.amplitudes if a is not None), key=lambda a: a.size / a.sigma)
    to = complex(surest.cos, surest.sin)
    return [
        float(np.angle(to * complex(a.cos, -a.sin)))
        if a is not None and a.size > TUNING.rig.doubt * a.sigma
        else 0.0
        for a in line.amplitudes
    ]
