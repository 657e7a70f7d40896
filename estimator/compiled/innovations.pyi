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
