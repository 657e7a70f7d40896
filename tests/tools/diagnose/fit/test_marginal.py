"""The evidence of a fit is the density of the recordings, whatever the sizes of its terms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gritd.estimator.effects import EFFECTS
from gritd.tools.diagnose.fit.columns import columns_of, whole
from gritd.tools.diagnose.fit.marginal import Marginal
from gritd.tools.diagnose.fit.nuisance import NuisanceColumns
from gritd.tools.diagnose.fit.problem import Fitted, free_of
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes

N = 40
SIZES = Sizes((0.0, 0.3, 1.0, 4.0), (0.1, 0.2, 0.3, 0.4))


def _marginal(strengths: int, seed: int = 0, split: int | None = None) -> tuple[Marginal, Any]:
    """One constant, some strengths, two columns of tolerance and two terms; split: where the values
    of the first end and those of the second begin.
    """
    rng = np.random.default_rng(seed)
    effects = (EFFECTS["viscous_friction"],)[:strengths]
    free = free_of(effects)
    jacobian, tolerance = rng.standard_normal((N, 1 + len(free))), rng.standard_normal((N, 2))
    columns = [rng.standard_normal((N, m)) for m in (3, 5)]
    if split is not None:
        columns[0][split:], columns[1][:split] = 0.0, 0.0
    sparse = [columns_of(c) for c in columns]
    terms = [RandomEffect(str(c.count), c, c, SIZES) for c in sparse]
    fixed = RandomEffect("tolerance", whole(tolerance), whole(tolerance), Sizes())
    residual, at = rng.standard_normal(N) * 2.0, rng.standard_normal(1 + len(free))
    fitted = Fitted(
        effects,
        free,
        at[:1],
        np.abs(at[1:]),
        np.zeros(N),
        residual,
        jacobian,
        jacobian,
        np.ones(jacobian.shape[1] + 2),
        np.zeros(2),
        0.0,
        NuisanceColumns(((fixed, 1.0),)),
        fixed.whitened.pulled(jacobian),
        np.zeros(jacobian.shape[1]),
        np.eye(jacobian.shape[1]),
        np.zeros(jacobian.shape[1], bool),
    )
    return Marginal(fitted, (fixed,), terms), (jacobian, tolerance, columns, residual, at)


@pytest.mark.parametrize("chosen", [(0, 0), (1, 3), (2, 0), (3, 3)])
@pytest.mark.parametrize("split", [None, 25])
def test_the_evidence_is_the_density_of_the_recordings(
    chosen: tuple[int, int], split: int | None
) -> None:
    """Of terms that act on the same values, and of terms that each have their own."""
    marginal, (jacobian, tolerance, columns, residual, at) = _marginal(0, split=split)
    values = residual + jacobian @ at  # seen from a constant of nought
    covariance = np.eye(N) + jacobian @ jacobian.T + tolerance @ tolerance.T
    for column, number in zip(columns, chosen, strict=True):
        covariance += SIZES.values[number] ** 2 * column @ column.T

    density = multivariate_normal(np.zeros(N), covariance).logpdf(values)
    prior = sum(SIZES.log_prior[number] for number in chosen)
    expected = density + 0.5 * N * np.log(2.0 * np.pi) + prior
    assert marginal.log_evidence(chosen) == pytest.approx(expected)


@pytest.mark.parametrize("split", [None, 25])
def test_all_that_is_told_is_that_of_the_normal_equations(split: int | None) -> None:
    """Mean and covariance of constants, tolerance and the weights of terms times their size."""
    marginal, (jacobian, tolerance, columns, residual, at) = _marginal(0, split=split)
    chosen, sizes = (2, 3), np.repeat((1.0, 4.0), (3, 5))
    whole = np.column_stack((jacobian, tolerance, np.column_stack(columns) * sizes))
    centre = np.append(at, np.zeros(10))
    covariance = np.linalg.inv(whole.T @ whole + np.eye(11))
    mean = centre + covariance @ (whole.T @ residual - centre)

    scale, wanted = np.append(np.ones(3), sizes), np.array([10, 0, 4, 2, 7])
    found = marginal._posterior(chosen, wanted)
    np.testing.assert_allclose(found[0], (mean * scale)[wanted])
    expected = (covariance * np.outer(scale, scale))[np.ix_(wanted, wanted)]
    np.testing.assert_allclose(found[1], expected, atol=1e-12)


def test_the_soil_is_told_with_no_channel_exact_beside_one_missed_by_much() -> None:
    """Where the equations miss one channel by its largest size, the smallest of another counts for
    the evidence, and not for what is known of the soil.
    """
    marginal, _ = _marginal(0)
    loose, _ = _marginal(0)
    sizes = Sizes((0.0, 0.003, 0.01, 0.03, 0.1, 0.3), (1.0,) * 6)
    for one, kind in ((marginal, "form"), (loose, "")):
        one.terms = tuple(replace(f, sizes=sizes, kind=kind) for f in one.terms)

    chosen = (5, 0)
    assert marginal._least(chosen) == (3, 3)
    assert loose._least(chosen) == (0, 0)
    assert marginal.log_evidence(chosen) == loose.log_evidence(chosen)
    assert all(min(sizes) >= 3 for sizes in marginal._weighed(chosen)[0])
