"""Projections of some values, and with other sizes of their directions."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.fit.projection import Projection, ResizedProjections, Surrogates


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


def test_directions_of_other_sizes_are_those_of_a_model_that_has_them() -> None:
    rng = np.random.default_rng(5)
    jacobian, residual = rng.standard_normal((30, 4)), rng.standard_normal(30)
    strain, columns = np.array([0.7, -1.2, 0.0, 0.0]), rng.standard_normal((30, 2))
    sizes = [np.ones(4), np.array([1.0, 1.0, 0.0, 2.5])]

    found = ResizedProjections(jacobian, residual, strain, sizes).project(columns)
    for size, (a, b) in zip(sizes, found, strict=True):
        expected = Projection(jacobian * size, residual, strain).project(columns)
        np.testing.assert_allclose(a, expected[0], atol=1e-12)
        np.testing.assert_allclose(b, expected[1], atol=1e-12)
