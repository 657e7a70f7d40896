from __future__ import annotations

import numpy as np
import pytest

from gritd.estimator.terramechanics.soils import DRY_SAND, LOOSE_SAND, MARS_LIKE
from gritd.tools.paper import separability
from gritd.tools.paper.closed_forms import WHEEL


@pytest.mark.parametrize(
    ("load", "low", "high"), [(40.0, 1.01, 1.06), (70.0, 0.69, 0.73), (120.0, 0.48, 0.52)]
)
def test_one_load_does_not_separate_cohesion_from_friction(
    load: float, low: float, high: float
) -> None:
    ratio = separability.sensitivity_ratio(DRY_SAND, np.linspace(0.05, 0.8, 6), load)
    assert np.all((ratio > low) & (ratio < high)), ratio


def test_linearisation_biases_the_fitted_cohesion_downwards() -> None:
    """What the effect stress_linearisation has to remove."""
    c, tan_phi = separability.fit(DRY_SAND.under(WHEEL.width))
    assert 690 < c < 760 and tan_phi == pytest.approx(0.62, abs=0.01)
    assert separability.fit(LOOSE_SAND.under(WHEEL.width))[0] < 0.7 * LOOSE_SAND.cohesion
    assert separability.fit(MARS_LIKE.under(WHEEL.width))[0] < 20
