"""Property tests find the same examples every time, and no machine is too slow for them.

`pytest --hypothesis-profile explore` looks for new ones. Linear algebra has one thread, as in every
command: the tests themselves run side by side, and sums in another order end in other digits.
"""

import os

import pytest
from hypothesis import HealthCheck, settings

for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

settings.register_profile(
    "gritd", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile(
    "explore", deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("gritd")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest begin first, so that none is left for one worker when all others have ended."""
    items.sort(key=lambda item: item.get_closest_marker("first") is None)
