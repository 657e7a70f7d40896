"""From one pass to fits: what is tried, from where, and what stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.side_wall_rubbing import SideWallRubbing
from gritd.estimator.stages.situation import Reaction, Situation
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.model import Model, does, fit_model
from gritd.tools.diagnose.fit.problem import free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.evidence import Weighed, varied_pass
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search import search as searching
from gritd.tools.diagnose.search.foretold import Predicted, gains, together
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import (
    _changed,
    _fitted_with,
    _free_near,
    _from_each_other,
    _retested,
    _with_effect,
    begin,
    extended,
)
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import diagnosed, plan, settings

pytestmark = pytest.mark.long


def searched(*acting: Effect, **given: Any) -> EffectSearch:
    """Recordings in which effects act, or none, after the first pass."""
    rig = wheel_rig(record(plan(**given), acting), settings())
    return begin(prepare_screening(fit_base(rig)))


def offered(model: Model, name: str, start: list[float], sizes: tuple[int, ...] = ()) -> Predicted:
    """An effect whose fit begins at parameters in expected sizes."""
    made = Signature(name, np.zeros((0, 0)), (), {})
    return Predicted(model, 9.0, (Weighed(made, 9.0, 9.0, np.array(start), sizes),), model)


def test_fits_have_the_same_bits_for_any_number_of_processes() -> None:
    """Also where another fit stood between."""
    search, found = searched(make("bulldozing", {"share": 0.75})), []
    for jobs in (1, 2):
        found.append(extended(search, [search.bare], 3, jobs).models[2:])

    assert len(found[0]) == 3
    assert [m.evidence for m in found[0]] == [m.evidence for m in found[1]]
    for alone, beside in zip(*found, strict=True):
        assert alone.fitted.u.tobytes() == beside.fitted.u.tobytes()
        assert alone.fitted.x.tobytes() == beside.fitted.x.tobytes()


def test_two_effects_that_hide_each_other_are_fitted_together() -> None:
    """A friction that goes with the load and one that is larger backward: one of them alone gains
    nothing, and others than these gain the most.
    """
    losses = (
        make("load_dependent_friction", {"arm": 0.004}),
        make("asymmetric_friction", {"difference": -0.1}),
    )
    search = searched(*losses)
    gain = {name: search.first.effects.gain(name) for name in search.first.effects.effects}
    assert gain["load_dependent_friction"] < 1.0
    assert max(gain, key=lambda name: gain[name]) not in (one.name for one in losses)

    alone = extended(search, [search.bare], TUNING.search.effects_first, 1)
    first = together(alone)[0]
    assert first.names == {one.name for one in losses}
    two = _with_effect(alone, first)
    assert two.evidence > alone.sized(1)[0].evidence + 20.0


def test_beside_one_effect_no_pair_promises_anything() -> None:
    search = searched(make("bulldozing", {"share": 0.75}))
    assert together(extended(search, [search.bare], 1, 1)) == []


def test_where_a_ripple_alone_raised_the_alarm_only_what_ripples_is_tried() -> None:
    """A friction may gain by chance what a ripple left over: it is not what stood out."""
    quiet = searched()
    assert not quiet.first.on_grid

    rippling = replace(quiet, first=replace(quiet.first, ripple=1e-9))
    assert rippling.first.alarmed
    tried = {predicted.effect for predicted in gains(rippling, rippling.bare, 1)}
    assert tried <= {"gear_ripple", "grousers", "hub_runout", "wheel_eccentricity"}


def test_a_candidate_whose_algebra_fails_ends_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its rivals are fitted, and it is reported which one failed."""
    bare = Model(cast(Any, None))
    every = [offered(bare, name, [0.0]) for name in ("coulomb_friction", "bulldozing")]
    monkeypatch.setattr(searching, "gains", lambda *_: every)

    def fitted(_: EffectSearch, predicted: Predicted) -> Model:
        if predicted.effect == "bulldozing":
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return replace(predicted.model, names=(predicted.effect,))

    monkeypatch.setattr(searching, "_with_effect", fitted)
    rig = SimpleNamespace(effects=dict.fromkeys(EFFECTS))
    problem = SimpleNamespace(stack=SimpleNamespace(rig=rig), nuisance=SimpleNamespace(parts=()))
    screening: Any = SimpleNamespace(problem=problem, forms=())
    search = EffectSearch(screening, (bare, bare), *cast(Any, (None, None, None)))

    found = extended(search, [bare], 3, 1)
    assert [model.names for model in found.models[2:]] == [("coulomb_friction",)]
    assert found.failed == (("bulldozing",),)


def test_the_order_of_a_ripple_stays_where_the_spectrum_has_it() -> None:
    """A count that leaves its line in the fit is another ripple."""
    rig = wheel_rig(
        record(plan(), (make("gear_ripple", {"order": 15.0, "ripple_cos": 0.3}),)), settings()
    )
    kind = rig.effects["gear_ripple"]
    start = np.array([1.0, 0.0, (15.0 - 40.0) / 30.0])
    *strengths, order = _free_near(rig, "gear_ripple", start)

    assert [f.parameter for f in strengths] == list(kind.parameters())[:2]
    turns = max(float(np.ptp(r.covariates["wheel_angle"])) for r in rig.runs) / (2.0 * np.pi)
    assert order.parameter.low == pytest.approx(15.0 - 1.0 / turns)
    assert order.parameter.high == pytest.approx(15.0 + 1.0 / turns)
    assert order.value(1e3) == order.parameter.high


def test_no_effect_owes_its_place_to_a_fit_that_ended_elsewhere() -> None:
    """The best model less an effect that was not fitted alone is, from where the model stands; and
    it is as likely as if its fit had begun by itself.
    """
    search = searched(make("bulldozing", {"share": 0.75}))
    alone = extended(search, [search.bare], 1, 1)
    (one,) = alone.models[2:]
    two = _with_effect(alone, offered(one, "viscous_friction", [0.1], one.chosen))
    caught = replace(search, models=(search.base, search.bare, two))
    assert caught.best() is two

    free = _retested(caught, two, 1)
    again = next(m for m in free.models if m.names == one.names)
    assert again.evidence == pytest.approx(one.evidence, abs=0.5)
    assert free.best() is again


def test_fits_end_where_they_end_whatever_they_begin_from() -> None:
    """No second fit is made of a model: the one without effects and that of one effect are as
    likely from where the model of two stands.
    """
    search = searched(make("bulldozing", {"share": 0.75}), make("slip_sinkage", {"growth": 0.3}))
    alone = extended(search, [search.bare], 1, 1)
    (one,) = alone.sized(1)
    (two,) = extended(alone, [one], 1, 1).sized(2)
    (added,) = {*two.names} - {*one.names}
    assert _changed(alone, two, added).evidence == pytest.approx(one.evidence, abs=1.0)
    none = fit_model(
        search.problem, search.screening.forms, (), (), (two.fitted.u, np.zeros(0)), two.sizes
    )
    assert none.evidence == pytest.approx(search.bare.evidence, abs=1.0)


def test_what_is_nearly_as_likely_is_fitted_from_where_the_other_stands() -> None:
    """A fit of one effect that got stuck a little below another's is made again from there."""
    search = searched(make("bulldozing", {"share": 0.75}))
    (one,) = extended(search, [search.bare], 1, 1).models[2:]
    other = replace(one, names=("viscous_friction",))
    stuck = replace(one, evidence=one.evidence - TUNING.search.little)
    caught = replace(search, models=(search.base, search.bare, other, stuck))

    again = next(m for m in _from_each_other(caught, 1).models if m.names == one.names)
    assert again.evidence == pytest.approx(one.evidence, abs=0.5)


@dataclass(frozen=True)
class RoughWall(SideWallRubbing):
    """A wall that is rough in waves of 60 mm."""

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        rough = 1.0 + 0.7 * np.cos(2.0 * np.pi * situation.position / 0.06)
        return SideWallRubbing.testbed(replace(self, share=self.share * rough), reaction, situation)


def test_no_effect_stands_in_a_model_twice() -> None:
    """Of three that are as likely alone, only one that the model lacks is tried in a place."""
    alone = [SimpleNamespace(names=(name,), evidence=100.0) for name in "abcd"]
    best = SimpleNamespace(names=("a", "b", "c"))
    search = SimpleNamespace(sized=lambda size: alone, has=lambda names: False)
    tried = searching._rivals(cast(Any, search), cast(Any, best))
    assert [(name, rival.names) for name, rival in tried] == [(n, ("d",)) for n in "abc"]


def test_an_effect_that_does_nothing_leaves_the_model() -> None:
    """A frame that does not give beside a friction: what a fit of both finds is the friction's."""
    search = searched(make("coulomb_friction", {"loss": 0.5}))
    friction, frame = EFFECTS["coulomb_friction"], EFFECTS["frame_compliance"]
    alone = fit_beside(search, (friction,), [1.0])
    both = fit_beside(search, (friction, frame), [1.0, 0.0])
    assert does(both.fitted)["frame_compliance"] == 0.0

    left = searching._acting(search, both)
    assert left.names == ("coulomb_friction",)
    assert left.evidence == pytest.approx(alone.evidence, abs=0.5)
    assert searching._acting(search, alone) is alone


def fit_beside(
    search: EffectSearch, effects: tuple[type[Effect], ...], start: list[float]
) -> Model:
    """Without a discrepancy of form."""
    begins = (np.zeros(len(search.bare.fitted.u)), np.array(start))
    sizes = tuple(0 for _ in search.screening.forms)
    return fit_model(
        search.problem, search.screening.forms, effects, free_of(effects), begins, sizes
    )


def test_what_varies_along_the_bed_tells_an_effect_whose_mean_the_soil_takes() -> None:
    """One load: a wall's mean friction looks like a weaker soil, its waves do not."""
    search = searched(RoughWall(0.05), loads=(70.0, 70.0))
    first = search.first.effects
    varied = varied_pass(search.problem, search.stand, first)
    assert varied.gain("side_wall_rubbing") > first.gain("side_wall_rubbing") + 50.0

    predicted = next(p for p in gains(search, search.bare, 1) if p.effect == "side_wall_rubbing")
    fitted = _with_effect(search, predicted)
    assert fitted.fitted.acting[0].share == pytest.approx(0.05, rel=0.25)  # type: ignore[attr-defined]
    assert fitted.evidence > search.bare.evidence + 50.0


def test_what_strains_the_constants_is_foretold_from_what_is_known_of_them() -> None:
    """From where a strong loss drove the constants no straight way leads back."""
    search = searched(make("coulomb_friction", {"loss": 0.8}))
    assert np.abs(search.bare.fitted.u).max() > TUNING.rig.doubt
    predicted = next(p for p in gains(search, search.bare, 1) if p.effect == "coulomb_friction")
    fitted = _with_effect(search, predicted)
    assert fitted.fitted.acting[0].loss == pytest.approx(0.8, rel=0.05)  # type: ignore[attr-defined]
    assert fitted.evidence == pytest.approx(predicted.evidence, abs=TUNING.search.little)


def test_an_effect_with_edges_is_fitted_from_several_places() -> None:
    patch = make("soil_patch", {"friction_change": -0.2, "centre": 0.2, "length": 0.2})
    search = searched(patch)
    predicted = next(p for p in gains(search, search.bare, 1) if p.effect == "soil_patch")
    assert 1 < len(predicted.starts) <= TUNING.search.again
    assert len({tuple(one.start) for one in predicted.starts}) == len(predicted.starts)
    best = _with_effect(search, predicted).evidence
    u = search.bare.fitted.u
    alone = [_fitted_with(search, predicted, x.start, x.sizes, u) for x in predicted.starts]
    assert best >= max(model.evidence for model in alone) - 1e-6


def test_a_small_effect_shows_beside_a_large_one_in_another_channel() -> None:
    """Whatever no formula takes of a large friction cannot pay for what a hub does to the sinkage;
    and what is as likely alone as that friction is so beside the hub.
    """
    acting = make("coulomb_friction", {"loss": 3.0}), make("hub_runout", {"lift_cos": 4e-4})
    drawn = plan(standstill=False, noise=2.0)
    found = diagnosed(drawn, acting)
    named = {h.effect: h for h in found.hypotheses if h.accepted}
    assert "hub_runout" in named, found.summary
    (other,) = set(named) - {"hub_runout"}
    group = {other, *named[other].indistinguishable_from}
    assert group >= {"coulomb_friction", "asymmetric_friction"}
