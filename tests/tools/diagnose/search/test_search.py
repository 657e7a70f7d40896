"""An effect is judged beside smaller discrepancies of form too: one learnt without the effect may
have taken its part.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.side_wall_rubbing import SideWallRubbing
from gritd.estimator.stages.situation import Reaction, Situation
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.settings import _smaller, settings_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search import promises as promising
from gritd.tools.diagnose.search import search as searching
from gritd.tools.diagnose.search.promises import Beside, Promise, _made, _tried, promises
from gritd.tools.diagnose.search.search import (
    Search,
    _bare,
    _free_near,
    _retested,
    _with_effect,
    begin,
    extended,
)
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

SIZES = st.lists(st.integers(0, 5), max_size=4).map(tuple)


@given(SIZES)
def test_settings_are_smaller_and_begin_with_the_models_own(sizes: tuple[int, ...]) -> None:
    found = _smaller(sizes)
    assert found[0] == sizes
    assert len(set(found)) == len(found)
    assert all(0 <= a <= b for other in found for a, b in zip(other, sizes, strict=True))
    assert tuple(0 for _ in sizes) in found


def test_fits_have_the_same_bits_for_any_number_of_processes() -> None:
    """Also where another fit stood between: a prediction begins at the one before."""
    rig = WheelRig(record(plan(), (make("bulldozing", {"share": 0.75}),)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(search, search.base)
    found = []
    for jobs in (1, 2):
        with rig.aside():
            found.append(extended(search, [bare], 3, jobs).models[1:])

    assert len(found[0]) == 3
    assert [m.evidence for m in found[0]] == [m.evidence for m in found[1]]
    for alone, beside in zip(*found, strict=True):
        assert alone.fitted.u.tobytes() == beside.fitted.u.tobytes()
        assert alone.fitted.x.tobytes() == beside.fitted.x.tobytes()


def test_an_effect_that_the_discrepancy_took_keeps_its_promise() -> None:
    effect = make("bulldozing", {"share": 0.75})
    rig = WheelRig(record(plan(), (effect,)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(search, search.base)
    assert max(bare.sizes) > 0

    kind, every = rig.effects["bulldozing"], settings_of(search.problem, bare)
    assert (every.sizes[0], every.costs[0]) == (bare.sizes, 0.0)
    beside = Beside(search.problem, search.first, bare, every)
    shapes = search.first.fixed["bulldozing"][: TUNING.search.again]
    tried = [p for made in _made(beside, kind, shapes) for p in _tried(beside, kind, made)]
    as_it_is = max(p.gain for p in tried if p.sizes == bare.sizes)
    best = next(p for p in promises(search.problem, search.first, bare) if p.effect is kind)
    assert best.gain > as_it_is + 5.0
    assert max(best.sizes) < max(bare.sizes)


def test_where_a_ripple_alone_raised_the_alarm_only_what_ripples_is_tried() -> None:
    """A friction may gain by chance what a ripple left over: it is not what stood out."""
    rig = WheelRig(record(plan(), ()), settings())
    rng = np.random.default_rng(0)
    quiet = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(quiet, quiet.base)
    assert not quiet.first.on_grid

    rippling = replace(quiet, first=replace(quiet.first, ripple=1e-9))
    assert rippling.first.alarmed
    tried = {promise.effect.name for promise in promises(rippling.problem, rippling.first, bare)}
    assert tried <= {"gear_ripple", "grousers", "hub_runout", "wheel_eccentricity"}


def test_a_candidate_whose_algebra_fails_ends_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rivals are fitted, and it is told which one failed."""
    kinds: list[Any] = [EFFECTS[name] for name in ("coulomb_friction", "bulldozing")]
    offered = [Promise(9.0, kind, np.zeros(1), ()) for kind in kinds]
    monkeypatch.setattr(searching, "promises", lambda *_: offered)

    def fitted(_: Search, model: Model, promise: Promise) -> Model:
        if promise.effect.name == "bulldozing":
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return replace(model, names=(promise.effect.name,))

    monkeypatch.setattr(searching, "_with_effect", fitted)
    rig = SimpleNamespace(aside=nullcontext, effects=dict.fromkeys(EFFECTS))
    problem = SimpleNamespace(stack=SimpleNamespace(rig=rig), allowance=SimpleNamespace(parts=()))
    screening: Any = SimpleNamespace(problem=problem, forms=())
    bare = Model(cast(Any, None))
    search = Search(screening, (bare, bare), cast(Any, None))

    found = extended(search, [bare], 3, 1)
    assert [model.names for model in found.models[2:]] == [("coulomb_friction",)]
    assert found.failed == (("bulldozing",),)


def test_the_order_of_a_ripple_stays_where_the_spectrum_has_it() -> None:
    """A count that leaves its line in the fit is another ripple."""
    rig = WheelRig(
        record(plan(), (make("gear_ripple", {"order": 15.0, "ripple_cos": 0.3}),)), settings()
    )
    kind = rig.effects["gear_ripple"]
    start = np.array([1.0, 0.0, (15.0 - 40.0) / 30.0])
    *strengths, order = _free_near(rig, Promise(1.0, kind, start, ()))

    assert [f.parameter for f in strengths] == list(kind.parameters())[:2]
    turns = max(float(np.ptp(r.covariates["wheel_angle"])) for r in rig.runs) / (2.0 * np.pi)
    assert order.parameter.low == pytest.approx(15.0 - 1.0 / turns)
    assert order.parameter.high == pytest.approx(15.0 + 1.0 / turns)
    assert order.value(1e3) == order.parameter.high


def test_no_effect_owes_its_place_to_a_fit_that_ended_elsewhere() -> None:
    """A model of one effect whose fit got stuck is fitted again from the model of two."""
    rig = WheelRig(record(plan(), (make("bulldozing", {"share": 0.75}),)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    search = replace(search, models=(search.base, _bare(search, search.base)))

    alone = extended(search, [search.bare], 1, 1)
    (one,) = alone.models[2:]
    beside = Promise(1.0, rig.effects["viscous_friction"], np.array([0.1]), one.sizes)
    two = _with_effect(alone, one, beside)
    stuck = replace(one, evidence=one.evidence - 200.0)
    caught = replace(search, models=(search.base, search.bare, stuck, two))
    assert caught.best() is two

    free = _retested(caught, two, 1)
    again = next(m for m in free.models if m.names == one.names)
    assert again.evidence == pytest.approx(one.evidence, abs=0.5)
    assert free.best() is again


@dataclass(frozen=True)
class RoughWall(SideWallRubbing):
    """A wall that is rough in waves of 60 mm."""

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        rough = 1.0 + 0.7 * np.cos(2.0 * np.pi * situation.position / 0.06)
        return SideWallRubbing.testbed(replace(self, share=self.share * rough), reaction, situation)


def test_what_varies_along_the_bed_tells_an_effect_whose_mean_the_soil_takes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One load: a wall's mean friction looks like a weaker soil, its waves do not."""
    rig = WheelRig(record(plan(loads=(70.0, 70.0)), (RoughWall(0.05),)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(search, search.base)
    search = replace(search, models=(search.base, bare))

    def promised() -> Promise:
        return next(
            p
            for p in promises(search.problem, search.first, bare)
            if p.effect.name == "side_wall_rubbing"
        )

    varied = promised()
    fitted = _with_effect(search, bare, varied)
    assert fitted.fitted.acting[0].share == pytest.approx(0.05, rel=0.25)  # type: ignore[attr-defined]
    assert fitted.evidence > bare.evidence + 50.0

    monkeypatch.setattr(promising, "varied_along_place", lambda *_: [])
    assert varied.gain > promised().gain + 50.0


def test_an_effect_with_edges_is_fitted_from_several_places() -> None:
    patch = make("soil_patch", {"friction_change": -0.2, "centre": 0.2, "length": 0.2})
    rig = WheelRig(record(plan(), (patch,)), settings())
    rng = np.random.default_rng(0)
    search = begin(prepare_screening(fit_base(rig, rng), rng))
    bare = _bare(search, search.base)
    search = replace(search, models=(search.base, bare))

    promise = next(
        p for p in promises(search.problem, search.first, bare) if p.effect.name == "soil_patch"
    )
    assert 0 < len(promise.others) <= TUNING.search.elsewhere
    starts = [tuple(p.start) for p in (promise, *promise.others)]
    assert len(set(starts)) == len(starts)
    best = _with_effect(search, bare, promise).evidence
    alone = [_with_effect(search, bare, replace(p, others=())).evidence for p in promise.others]
    assert best >= max(alone) - 1e-6
