"""What `--apply` writes of δ beside a soil."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.explain.learnt import _parted


def test_soil_at_its_bound_is_correlated_with_nothing() -> None:
    """A cohesion that is held at 0 has no width: that must not end a diagnosis."""
    covariance = np.array([[4.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    sigma, correlation = _parted(covariance)
    np.testing.assert_allclose(sigma, [2.0, 1.0, 1.0])
    np.testing.assert_allclose(correlation, [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]])
