import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

def solve(
    given: Array,  # (11, n) contiguous
    found: Array,  # (7, n)
    nodes: Array,  # (2, order), places and weights
    size: int,
    order: int,
    radius: float,
    width: float,
    shallowest: float,
    deepest: float,
    tolerance: float,
    fine: float,  # 0.0 without a beginning
    rounds: int,
    /,
) -> None: ...
