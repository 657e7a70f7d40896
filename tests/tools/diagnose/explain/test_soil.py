"""The soil that is reported is that of the campaign in question."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.effects import make
from gritd.estimator.model.learnt import LearntForm
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain import learnt
from gritd.tools.diagnose.explain.learnt import learnt_form
from gritd.tools.diagnose.explain.result import Quantity
from gritd.tools.diagnose.explain.soil import _beside_prior, _quantity, _soil_of
from gritd.tools.diagnose.fit.discrepancy import form_terms
from gritd.tools.diagnose.fit.model import Model, sized_model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.held import held_form
from gritd.tools.diagnose.rig.interface import HAD, Constant
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from gritd.tools.proof.real.judge import rms
from tests.tools.diagnose.campaigns import plan, settings

C = Constant("c", 1000.0, 200.0, "Pa", soil=True, log=True)


def _rig(*constants: Constant) -> Any:
    return SimpleNamespace(constants=constants)


def test_a_bed_prepared_anew_has_its_own_soil() -> None:
    """c of the reference 1000 e^0.2, changed by e^0.1; both σ count, and their covariance."""
    rig = _rig(C, Constant("new_c", 0.0, 0.1, changes="c"))
    mean, spread = np.array([1.0, 1.0]), np.array([[0.04, -0.01], [-0.01, 0.25]])
    told = _quantity(rig, C, mean, spread)

    value = 1000.0 * np.exp(0.3)
    relative = np.sqrt(0.2**2 * 0.04 + 0.1**2 * 0.25 - 2.0 * 0.2 * 0.1 * 0.01)
    assert told.value == pytest.approx(value)
    assert told.sigma == pytest.approx(value * relative)


@pytest.mark.parametrize("known", [C, Constant("tan_phi", 0.6, 0.06, "", soil=True)])
@pytest.mark.parametrize("strain", [-5.0, -1.9, 0.0, 1.9, 4.0])
def test_a_soil_that_contradicts_what_was_known_is_as_uncertain_as_that(
    known: Constant, strain: float
) -> None:
    """What was known lies within two of its σ; a soil that agrees stays as it was found."""
    found = Quantity(known.of(strain), known.spread(strain, 0.1), known.unit)
    told = _beside_prior(known, found)
    assert told.value == found.value
    if abs(strain) <= 2.0:
        assert told == found
    else:
        assert told.sigma == pytest.approx(known.spread(strain, abs(strain) / 2.0))


def test_one_bed_has_one_soil() -> None:
    told = _quantity(
        _rig(C, Constant("zero", 0.0, 0.1)), C, np.array([0.5, 3.0]), np.diag([0.09, 1.0])
    )
    assert told.value == pytest.approx(1000.0 * np.exp(0.1))
    assert told.sigma == pytest.approx(told.value * 0.2 * 0.3)


@cache
def _fitted() -> tuple[Problem, Model]:
    """A rig whose reference showed that it pushes soil."""
    shown = ConfiguredEffect("bulldozing", {"share": Uncertain(1.0, 1.0)})
    runs = record(plan(seconds=24.0), (make("bulldozing", {"share": 1.0}),))
    rig = wheel_rig(runs, settings()).having((shown,))
    base = fit_base(rig)
    forms = form_terms(base.problem.stack, base.problem.noise)
    none = tuple(0 for _ in forms)
    return base.problem, sized_model(base.problem, forms, (base.fitted.u, np.zeros(0)), none)


def test_what_the_reference_shows_is_no_exact_form() -> None:
    """c and tan φ are less certain than by our form of it: another one may move the soil and hardly
    the fit.
    """
    problem, model = _fitted()
    rig, (mean, spread) = problem.stack.rig, model.constants()
    for known in (k for k in rig.constants if k.name in ("c", "tan_phi")):
        exact = _quantity(rig, known, mean, spread)
        told = _soil_of(problem, model)[known.name]
        assert told.sigma > 1.1 * exact.sigma
        assert abs(told.value - exact.value) < 2.0 * told.sigma


def test_what_is_written_beside_the_soil_has_its_other_forms_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Else the on-line filter would take our form as exact, and be too sure of the soil again."""
    problem, model = _fitted()
    soil = _soil_of(problem, model)
    told = learnt_form(problem, model, soil)
    monkeypatch.setattr(learnt, "with_forms_had", lambda _, model: model)
    exact = learnt_form(problem, model, soil)
    assert told is not None and exact is not None
    assert _open(told) > 1.5 * _open(exact)


def test_soil_effects_and_what_is_written_beside_them_add_up_to_what_was_fitted() -> None:
    """Whatever soil is written, an average over several explanations say: a configuration that
    sinks the wheel twice as deep as it was measured models nothing.
    """
    problem, model = _fitted()
    rig, soil = problem.stack.rig, _soil_of(problem, model)
    other = {name: replace(q, value=1.2 * q.value) for name, q in soil.items()}
    alone, whole = zip(*(_as_it_is_written(problem, model, s) for s in (soil, other)), strict=True)
    for channel in ("drawbar_pull", "sinkage"):
        own = problem.stack.of(channel)
        by_soil = rms((alone[1] - alone[0])[own])
        assert by_soil > 10.0 * problem.noise.colours[rig.channels.index(channel)].sigma
        assert rms((whole[1] - whole[0])[own]) < 0.05 * by_soil


def _as_it_is_written(
    problem: Problem, model: Model, soil: dict[str, Quantity]
) -> tuple[Array, Array]:
    """The prediction (N,) with a soil and calibration as it was stated, and with δ beside it."""
    form = learnt_form(problem, model, soil)
    assert form is not None
    stack, rig = problem.stack, problem.stack.rig
    held = held_form(form, rig.runs, rig.channels, settings().wheel.radius, lost=False)
    known = zip(rig.constants, model.fitted.u, strict=True)
    u = [k.strain(soil[k.name].value) if k.soil else x * (k.kind == HAD) for k, x in known]
    alone = stack.predict(np.array(u))
    return alone, alone + stack.joined(held.means)


def _open(form: LearntForm) -> float:
    """What δ leaves open of the drawbar pull [N²], added up over its features."""
    channel = form.drawbar_pull
    assert channel is not None
    return channel.size**2 * float(np.sum(np.square(channel.spread)) + channel.rest**2)
