import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

def fill(
    columns: Array,
    kept: Array,
    gain: Array,
    scale: Array,
    slow: Array,
    fast: Array,
    out: Array,
    length: int,
    colours: int,
    width: int,
    first: int,
    rows: int,
    /,
) -> None: ...
def gains(
    kept: Array,  # (2, n, g) contiguous, slow and fast
    share: Array,  # (2, g)
    white: Array,  # (n, g)
    gain: Array,  # (2, n, g)
    variance: Array,  # (n, g)
    length: int,
    colours: int,
    /,
) -> None: ...
