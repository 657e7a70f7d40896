"""What varies along the bed tells a strength, if the strength may vary so."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.tools.diagnose.screen.evidence import _positive_everywhere


@pytest.mark.parametrize(
    ("mean", "known", "least", "most"),
    [(3.0, 1e4, 0.99, 1.0), (0.0, 1e4, 0.0, 1e-3), (0.0, 0.0, 0.5, 1.0), (-1.0, 1e4, 0.0, 1e-3)],
)
def test_a_positive_strength_varies_by_no_more_than_it_is(
    mean: float, known: float, least: float, most: float
) -> None:
    """A mean that is far above what varies, that is nought, that nobody knows, that is negative."""
    curvature = np.diag([known, 1e4, 1e4, 1e4])
    waves = np.array([mean, 1.0, -1.0, 1.0])
    pull = np.diag(curvature) * waves
    share = float(np.exp(_positive_everywhere(curvature[None], pull[None], 0, 1)[0]))
    assert least <= share <= most
