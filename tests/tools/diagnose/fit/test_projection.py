"""A projection of some values is that of a campaign which has no others."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.fit.projection import Projection, Surrogates


def test_marked_values_tell_by_themselves() -> None:
    rng = np.random.default_rng(3)
    jacobian, residual = rng.standard_normal((30, 4)), rng.standard_normal(30)
    strain, columns = rng.standard_normal(4), rng.standard_normal((30, 2))
    drawn = Surrogates(rng.standard_normal((30, 5)), rng.standard_normal((4, 5)))
    rows = np.arange(30) % 3 > 0

    whole = Projection(jacobian, residual, strain, drawn).of_rows(rows)
    few = Surrogates(drawn.residuals[rows], drawn.strains)
    alone = Projection(jacobian[rows], residual[rows], strain, few)
    acting = np.where(rows[:, None], columns, 0.0)
    found, expected = whole.project_all(acting), alone.project_all(columns[rows])
    np.testing.assert_allclose(found.a, expected.a)
    np.testing.assert_allclose(found.b, expected.b)
