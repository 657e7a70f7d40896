from __future__ import annotations

import numpy as np

from gritd.tools.paper import closed_forms


def test_closed_forms_solve_their_integrals() -> None:
    assert all(
        values.max() < 2e-13 for values in closed_forms.closed_form_differences(seed=1).values()
    )


def test_linearised_exponent_is_good_at_large_slip_and_poor_at_small() -> None:
    gaps = [
        np.max(np.abs(np.subtract(*closed_forms.exponents(slip)))) for slip in (0.05, 0.2, 0.5, 0.8)
    ]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[0] > 0.05 and gaps[-1] < 0.03
