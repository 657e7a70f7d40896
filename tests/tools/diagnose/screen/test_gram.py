"""The one pass: what is left of columns for each size of the discrepancy, and Bayes factors."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.effects import make
from gritd.tools.diagnose.fit.columns import whole
from gritd.tools.diagnose.fit.evidence import log_bayes, log_bayes_alone
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.gram import Gram
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import begin
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


@cache
def begun() -> EffectSearch:
    """A campaign in which soil is pushed ahead of the wheel."""
    rig = wheel_rig(record(plan(), (make("bulldozing", {"share": 0.75}),)), settings())
    return begin(prepare_screening(fit_base(rig)))


@pytest.mark.parametrize("which", [0, 3])
@pytest.mark.long
def test_columns_are_judged_beside_a_discrepancy_of_each_size(which: int) -> None:
    """As beside a model that has it of this size alone."""
    search = begun()
    problem, bare = search.problem, search.bare
    gram = Gram(problem, bare)
    columns = np.random.default_rng(2).standard_normal((problem.stack.size, 3))
    a, b = gram.project(columns)

    assert bare.marginal is not None
    fitted, chosen = bare.fitted, gram.sizes[which].chosen
    sized = zip(bare.marginal.terms, chosen, strict=True)
    forms = [f.sizes.values[number] * f.whitened.dense for f, number in sized]
    own = fitted.own / fitted.penalty[: fitted.centre.size]
    jacobian = np.column_stack((own, *(f.whitened.dense for f in problem.fixed), *forms))
    strain = np.zeros(jacobian.shape[1])
    strain[: fitted.centre.size] = fitted.centre * fitted.penalty[: fitted.centre.size]

    expected = Projection(whole(jacobian), fitted.residual, strain).project(columns)
    np.testing.assert_allclose(a[which], expected[0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(b[which], expected[1], rtol=1e-6, atol=1e-5)


def test_the_sizes_tried_hold_the_models_own_and_none() -> None:
    search = begun()
    tried = [one.chosen for one in Gram(search.problem, search.bare).sizes]
    assert tried[0] == search.bare.sizes and len(set(tried)) == len(tried)
    assert tuple(0 for _ in search.bare.sizes) in tried


def test_an_effect_that_the_discrepancy_took_is_told_beside_a_smaller_one() -> None:
    search = begun()
    assert max(search.bare.sizes) > 0
    assert max(search.first.effects.effects, key=search.first.effects.gain) == "bulldozing"
    assert max(search.first.effects.effects["bulldozing"][0].sizes) < max(search.bare.sizes)


@given(st.integers(1, 4), st.integers(0, 10_000))
def test_bayes_factors_of_many_sizes_are_those_of_each(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    roots = rng.standard_normal((5, 6, count)) * 10.0 ** rng.uniform(-2, 1, count)
    a, b = roots.swapaxes(1, 2) @ roots, rng.standard_normal((5, count)) * 3.0
    sign = rng.integers(0, 2, count).tolist()
    found = log_bayes(a, b, sign)
    expected = [log_bayes(a[k], b[k], sign) for k in range(5)]
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)
    if count == 1:
        alone = log_bayes_alone(a[:, :, 0], b, sign)[:, 0]
        np.testing.assert_allclose(alone, expected, rtol=1e-8, atol=1e-8)
