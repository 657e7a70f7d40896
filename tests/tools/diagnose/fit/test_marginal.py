"""The evidence for all sizes of a term at once is that of each size by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gritd.estimator.effects import EFFECTS
from gritd.tools.diagnose.fit.columns import whole
from gritd.tools.diagnose.fit.marginal import Marginal
from gritd.tools.diagnose.fit.nuisance import NuisanceColumns
from gritd.tools.diagnose.fit.problem import Fitted, free_of
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes

N = 40
SIZES = Sizes((0.0, 0.3, 1.0, 4.0), (0.1, 0.2, 0.3, 0.4))


def _marginal(strengths: int, seed: int = 0) -> tuple[Marginal, Any]:
    """One constant, some strengths, two columns of tolerance and two terms."""
    rng = np.random.default_rng(seed)
    effects = (EFFECTS["viscous_friction"],)[:strengths]
    free = free_of(effects)
    jacobian, tolerance = rng.standard_normal((N, 1 + len(free))), rng.standard_normal((N, 2))
    columns = [rng.standard_normal((N, m)) for m in (3, 5)]
    terms = [RandomEffect(str(c.shape), whole(c), whole(c), SIZES) for c in columns]
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


@pytest.mark.parametrize("strengths", [0, 1])
def test_the_sizes_of_a_freedom_are_told_at_once(strengths: int) -> None:
    every, single = _marginal(strengths)[0], _marginal(strengths)[0]
    for chosen in ((0, 0), (2, 3), (1, 1)):
        for number in range(2):
            for these in every._along(chosen, number):
                assert every.log_evidence(these) == pytest.approx(single._log_evidence(these))


def test_the_evidence_is_the_density_of_the_recordings() -> None:
    marginal, (jacobian, tolerance, columns, residual, at) = _marginal(0)
    chosen = (1, 3)
    values = residual + jacobian @ at  # seen from a constant of nought
    covariance = np.eye(N) + jacobian @ jacobian.T + tolerance @ tolerance.T
    for column, number in zip(columns, chosen, strict=True):
        covariance += SIZES.values[number] ** 2 * column @ column.T

    density = multivariate_normal(np.zeros(N), covariance).logpdf(values)
    prior = sum(SIZES.log_prior[number] for number in chosen)
    expected = density + 0.5 * N * np.log(2.0 * np.pi) + prior
    assert marginal.log_evidence(chosen) == pytest.approx(expected)


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
