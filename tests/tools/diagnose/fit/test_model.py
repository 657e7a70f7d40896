"""A model's fit: where it begins, and with which terms it stands."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from gritd.estimator.effects import EFFECTS, make
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.discrepancy import form_terms
from gritd.tools.diagnose.fit.model import fit_model
from gritd.tools.diagnose.fit.problem import free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.tuning import replaced
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

PEAK = EFFECTS["stress_peak_shift"]


@cache
def shifted() -> BaseFit:
    """A stress peak three expected sizes off: without the effect, constants are strained far."""
    acting = (make("stress_peak_shift", {"share": -0.3}),)
    rig = wheel_rig(record(plan(seconds=12.0), acting), settings())
    return fit_base(rig)


@pytest.mark.parametrize("start", [(-3.0, 0.0), (4.5, 0.8), (-5.0, 5.0)])
def test_a_strong_effect_is_found_from_wherever_linear_algebra_starts_it(
    start: tuple[float, float],
) -> None:
    """Beside strained constants the linear estimate of a strength may lie beyond a ridge."""
    base, free = shifted(), free_of((PEAK,))
    fitted = base.problem.descend((PEAK,), free, base.fitted.u, np.array(start))
    assert fitted.converged
    assert fitted.x == pytest.approx([-3.0, 0.0], abs=0.1)


def test_a_fit_of_no_rounds_stands_where_it_is_put() -> None:
    base, free = shifted(), free_of((PEAK,))
    fitted = base.problem.descend((PEAK,), free, base.fitted.u, np.array([4.5, 0.8]), rounds=0)
    assert fitted.x == pytest.approx([4.5, 0.8])


def test_a_fit_near_by_has_the_products_of_its_slopes() -> None:
    """Also where other terms are allowed than in the fit that it comes from."""
    base = shifted()
    free = free_of((PEAK,))
    fitted = base.problem.descend((PEAK,), free, base.fitted.u, np.array([4.5, 0.8]), rounds=0)
    terms = form_terms(base.problem.stack, base.problem.noise)
    for problem in (base.problem, base.problem.with_terms(terms, [0.1] * len(terms))):
        ground = problem.ground(fitted.effects, fitted.free)
        for step in (0.0, 0.1):
            moved = ground.moved(fitted, ground.tried(fitted.centre + step)[0])
            pulled = problem.nuisance.pulled(moved.own)
            nuisance = problem.nuisance.gram + np.eye(problem.nuisance.count)
            fixed = np.diag(moved.penalty[: moved.centre.size] ** 2)
            left = moved.own.T @ moved.own - pulled.T @ np.linalg.solve(nuisance, pulled)
            assert np.allclose(moved.pulled, pulled, rtol=1e-9, atol=1e-9 * np.abs(pulled).max())
            assert np.allclose(moved.curvature, left + fixed, rtol=1e-6)
            foretold = fitted.predicted + moved.raw @ (moved.centre - fitted.centre)
            assert np.allclose(moved.predicted, foretold)


def test_a_fit_stands_where_its_evidence_is_told() -> None:
    """Beside a gain of the potentiometer, bent far enough, sinkage that grows with slip needs no
    discrepancy of form. A fit with neither of the two would strain the constants, and the evidence
    would be told from there.
    """
    acting = (make("slip_sinkage", {"growth": 0.4}),)
    rig = wheel_rig(record(plan(seconds=12.0), acting), settings())
    base = fit_base(rig)
    forms = form_terms(base.problem.stack, base.problem.noise)

    effects = (EFFECTS["sinkage_gain"],)
    begins, sizes = (base.fitted.u, np.array([1.0])), tuple(3 for _ in forms)
    model = fit_model(base.problem, forms, effects, free_of(effects), begins, sizes)

    mean, _ = model.constants()
    of_soil = np.array([c.soil for c in rig.constants])
    assert model.form_sizes[-1] > 0.0
    assert np.abs(mean - model.fitted.u)[of_soil].max() < 1.0
    assert model.evidence > -1200.0  # -1250 without its terms


def test_two_effects_that_are_nearly_one_stand_where_their_evidence_is_told() -> None:
    """Each could take the other's part from round to round, if other forms were always made anew:
    the evidence would count a step that leads nowhere.
    """
    both = (EFFECTS["side_slip"], EFFECTS["pulley_slip"])
    acting = (make("side_slip", {"angle": 0.3}),)
    rig = wheel_rig(record(plan(seconds=12.0), acting), settings())
    base = fit_base(rig)
    forms = form_terms(base.problem.stack, base.problem.noise)

    begins = base.fitted.u, np.array([0.5, 0.0, 0.0, 0.0, 0.0, 2.0])
    sizes = tuple(0 for _ in forms)
    model = fit_model(base.problem, forms, both, free_of(both), begins, sizes)
    assert model.marginal is not None
    assert model.marginal.gain(model.chosen) < 0.5


@pytest.mark.parametrize("rounds", [1, 2, 30])
def test_the_evidence_counts_no_more_than_the_fit_reached(rounds: int) -> None:
    """What the slopes promise beyond where it stands is not counted; nothing, at an optimum."""
    base = shifted()
    begins, free = (base.fitted.u, np.array([-1.0, 0.0])), free_of((PEAK,))
    forms = form_terms(base.problem.stack, base.problem.noise)
    sizes = tuple(0 for _ in forms)

    with replaced("numerics", rounds=rounds, size_rounds=1):
        model = fit_model(base.problem, forms, (PEAK,), free, begins, sizes)
    assert model.marginal is not None
    promised = model.marginal.gain(model.chosen)
    sizes, average = model.marginal.likeliest(model.chosen)
    reached = average if sizes == model.chosen else model.marginal.log_evidence(model.chosen)
    assert model.evidence == pytest.approx(reached - promised)
    assert model.fitted.converged == (rounds == 30)
    assert (promised > 1.0) == (rounds < 30)
