"""What all tests of the diagnosis share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Effects may run away in a fit, which numpy would warn of."""
    with np.errstate(all="ignore"):
        yield
