"""The arithmetic that a tick spends most of its time in, as C, where it was built.

Pure Python with the same bits stands next to each function: what computes a recording does not show
in it. `closed.c` is terramechanics/scalar.py with filter/shift.py, `algebra.c` is
filter/estimate.py with filter/plain_engine.py, `record.c` is filter/evidence.py. A test compares
them on drawn values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gritd.estimator.compiled.sources import check_sources

try:
    from gritd.estimator.compiled import algebra, closed, record

    check_sources(algebra, closed, record)
    from gritd.estimator.compiled.algebra import dot, mixed, update, variance
    from gritd.estimator.compiled.closed import Closed
    from gritd.estimator.compiled.record import evidence
except ImportError:  # no compiler where gritd was installed, or what an older version left
    BUILT = False
else:
    BUILT = True

__all__ = [
    "BUILT",
    "Closed",
    "dot",
    "evidence",
    "integer_sum",
    "mixed",
    "total",
    "update",
    "variance",
]

# what a user reads where it was not
IN_PYTHON = (
    "in Python, a tick takes three times as long: the C of this version was not compiled; "
    "expected gritd's wheel, or gcc and another installation"
)

# the one `sum` of estimator: integers, which no order and no version of Python adds otherwise
integer_sum: Callable[[Iterable[int]], int] = sum


def total(values: list[float]) -> float:
    """Sum, term by term: newer versions of Python compensate what `sum` rounds."""
    if BUILT:
        return algebra.total(values)

    added = 0.0
    for value in values:
        added += value
    return added
