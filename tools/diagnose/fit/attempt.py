"""Work of one candidate whose algebra may fail: that ends the candidate, not the diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

Made = TypeVar("Made")


def attempted(work: Callable[[], Made]) -> Made | None:
    """What work gives; None where its algebra fails."""
    try:
        return work()
    except np.linalg.LinAlgError:
        return None
