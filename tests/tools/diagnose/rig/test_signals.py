"""What the counts of two encoders leave open of their ratio."""

from __future__ import annotations

import numpy as np

from gritd.estimator.offline.windows import block_slope
from gritd.tools.diagnose.rig.signals import doubt

EDGES = np.arange(0.0, 5.05, 0.1)


def test_a_wheel_that_stands_leaves_nothing_open() -> None:
    time = np.arange(0.0, 5.0, 0.004)
    still, moving = (block_slope(time, rate * time, EDGES) for rate in (0.0, 1.0))
    assert not doubt(still, moving).any()
