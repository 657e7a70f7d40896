"""Innovations under coloured noise by C, where it was built; the numpy loop with the same bits
stands in tools/diagnose/noise/colour.py. A test compares them.
"""

from __future__ import annotations

from gritd.estimator.compiled.sources import check_sources

try:
    from gritd.estimator.compiled import innovations

    check_sources(innovations)
    from gritd.estimator.compiled.innovations import fill, gains
except ImportError:  # no compiler where gritd was installed
    BUILT = False
else:
    BUILT = True

__all__ = ["BUILT", "fill", "gains"]
