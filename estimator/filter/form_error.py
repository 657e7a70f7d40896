"""What the closed forms miss on a rig of which nothing was learnt: a smooth error of torque and
pull over slip and load, of unknown size.

Every model of a wheel in soil is somewhat wrong. The error of the torque is r W e(i, W), that of
the drawbar pull W e′(i, W), with e and e′ of the covariance function of model/discrepancy.py. Each
is held by its values at the nodes of a grid, between which it is linear. The nodes of the load
count in pressures W/(r b), so that they are the same for every run of a rig.

How large e is, is not known before the run. So the filter runs once for each size, and weighs them
by what they foretold (bank.py).
"""

from __future__ import annotations

from math import log

import numpy as np

from gritd.estimator.filter.estimate import Vector
from gritd.estimator.model.discrepancy import LOAD, SLIP, covariance
from gritd.estimator.terramechanics.soil import Array, Wheel

SLIPS = (0.0, 0.25, 0.5, 0.75)
LOADS = (-1.0, 0.0, 1.0)  # ln of W/(r b) over USUAL
USUAL = 1e4  # [Pa] what a rover's wheel bears on its r b
NODES = len(SLIPS) * len(LOADS)


def shares(wheel: Wheel, slip: float, load: float) -> Vector:
    """Weight of each node (NODES,) in the error under a window; load [N]."""
    pressure = log(max(load, 1e-6) / (wheel.radius * wheel.width * USUAL))
    along, across = _hats(SLIPS, slip), _hats(LOADS, pressure)
    return tuple([a * b for a in along for b in across])


def prior() -> Array:
    """Covariance (NODES, NODES) of the error at the nodes, of size one."""
    nodes = np.array([(slip / SLIP, load / LOAD) for slip in SLIPS for load in LOADS])
    return covariance(nodes, nodes)


def _hats(nodes: Vector, x: float) -> Vector:
    """Linear interpolation: weight of each node at x, which is held inside."""
    step, last = nodes[1] - nodes[0], len(nodes) - 2
    along = min(max((x - nodes[0]) / step, 0.0), last + 1.0)
    at = min(int(along), last)
    weights = [0.0] * len(nodes)
    weights[at], weights[at + 1] = at + 1.0 - along, along - at
    return tuple(weights)
