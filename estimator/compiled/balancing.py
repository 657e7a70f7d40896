"""The vertical balance by C, where it was built; the same in numpy, for any contact, stands in
estimator/model/balance.py. A test compares them.
"""

from __future__ import annotations

from gritd.estimator.compiled.sources import check_sources

try:
    from gritd.estimator.compiled import balance

    check_sources(balance)
    from gritd.estimator.compiled.balance import solve
except ImportError:  # no compiler where gritd was installed
    BUILT = False
else:
    BUILT = True

__all__ = ["BUILT", "solve"]
