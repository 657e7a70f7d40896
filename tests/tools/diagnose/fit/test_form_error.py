"""Other forms of an effect: what it does may follow over an arc of rolling."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.hub_runout import HubRunout
from gritd.estimator.effects.side_wall_rubbing import SideWallRubbing
from gritd.estimator.stages.history import followed, run_begins
from gritd.estimator.stages.situation import Reaction, Situation
from gritd.estimator.terramechanics.soil import Scalar
from gritd.tools.diagnose.fit.form_error import _following, added_by, baseline_terms, form_errors
from gritd.tools.diagnose.fit.model import fit_model
from gritd.tools.diagnose.fit.problem import Problem, free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import LOADS, diagnosed, plan, settings

pytestmark = pytest.mark.long


@cache
def _stack() -> Stack:
    runs = record(plan(seed=3, seconds=40.0), (make("grousers", {"grip": 0.2}),))
    return Stack(wheel_rig(runs, settings()))


@cache
def _problem() -> Problem:
    return fit_base(_stack().rig).problem


def test_an_effect_that_follows_is_within_its_freedom() -> None:
    """A step of what an effect does, one radian of rolling behind, is a combination of the
    columns; and they hold nothing where the effect has stood long enough.
    """
    stack = _stack()
    group = np.asarray(stack.run * len(stack.rig.channels) + stack.channel, dtype=float)
    begins = run_begins(group, stack.size)
    added = np.where(stack.covariate("slip") > 0.2, 1.0, 0.5)
    columns = _following(stack, added)
    assert columns.shape == (stack.size, 2 * len(TUNING.fit.following_arcs))

    angle = stack.covariate("wheel_angle")
    turned = np.where(begins, 0.0, np.abs(np.diff(angle, prepend=angle[0])))
    behind = followed(added, -np.expm1(-turned / 1.0), group) - added
    left = behind - columns @ np.linalg.lstsq(columns, behind, rcond=None)[0]
    assert np.max(np.abs(left)) < 1e-9
    assert np.max(np.abs(behind)) > 0.2


@pytest.mark.parametrize(("name", "follows"), [("bulldozing", True), ("coulomb_friction", False)])
def test_what_soil_does_builds_up_and_what_a_drive_does_begins_at_once(
    name: str, follows: bool
) -> None:
    problem = _problem()
    stack, effect = problem.stack, EFFECTS[name]
    free = free_of((effect,))
    fitted = problem.descend(
        (effect,), free, np.zeros(len(stack.rig.constants)), np.ones(len(free)), rounds=0
    )
    *_, term = form_errors(stack, problem.noise, fitted)

    plain = stack.predict(np.zeros(len(stack.rig.constants)), ())
    added = fitted.predicted - plain
    building = added * np.exp(-_rolled(stack) / 1.0)
    every = np.column_stack((term.columns.dense, fitted.raw[:, len(fitted.u) :]))
    left = building - every @ np.linalg.lstsq(every, building, rcond=None)[0]
    assert (np.linalg.norm(left) < 1e-6 * np.linalg.norm(building)) == follows


def test_an_effect_may_do_more_one_way_than_the_other() -> None:
    """As a gear that loses torque makes an inertia larger when it is sped up."""
    problem = _problem()
    stack, effect = problem.stack, EFFECTS["wheel_inertia"]
    free = free_of((effect,))
    none = np.zeros(len(stack.rig.constants))
    fitted = problem.descend((effect,), free, none, np.ones(len(free)), rounds=0)
    *_, term = form_errors(stack, problem.noise, fitted)

    added = fitted.predicted - stack.predict(none, ())
    assert added.min() < 0.0 < added.max()
    every = np.column_stack((term.columns.dense, fitted.raw[:, len(none) :]))
    left = np.abs(added) - every @ np.linalg.lstsq(every, np.abs(added), rcond=None)[0]
    assert np.linalg.norm(left) < 1e-6 * np.linalg.norm(added)


def _rolled(stack: Stack) -> np.ndarray:
    """Angle [rad] that the wheel has turned since each run began (N,)."""
    out = np.zeros(stack.size)
    for channel, number in stack.parts:
        own = np.flatnonzero(stack.of(channel) & (stack.run == number))
        angle = stack.covariate("wheel_angle")[own]
        out[own] = np.cumsum(np.abs(np.diff(angle, prepend=angle[0])))
    return out


def test_every_run_and_channel_begins_anew() -> None:
    stack = _stack()
    columns = _following(stack, np.ones(stack.size))
    for channel, number in stack.parts:
        own = np.flatnonzero(stack.of(channel) & (stack.run == number))
        np.testing.assert_allclose(columns[own[0], 1::2], -1.0)
        np.testing.assert_allclose(columns[own, 0::2], 0.0, atol=1e-12)


def _drifting(zero: np.ndarray) -> float:
    """Share of a drift (N,) of the drawbar pull's zero that is outside the term of
    `sensor_drift`.
    """
    problem = _problem()
    stack, effect = problem.stack, EFFECTS["sensor_drift"]
    free = free_of((effect,))
    start = np.array([float(f.parameter.name == "drawbar_pull") for f in free])
    none = np.zeros(len(stack.rig.constants))
    fitted = problem.descend((effect,), free, none, start, rounds=0)

    terms = form_errors(stack, problem.noise, fitted)
    every = np.column_stack([*(f.columns.dense for f in terms), fitted.raw[:, len(none) :]])
    drift = np.where(stack.of("drawbar_pull"), zero, 0.0)
    left = drift - every @ np.linalg.lstsq(every, drift, rcond=None)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(drift))


def test_a_zero_may_creep_in_any_way_and_be_set_anew_before_each_run() -> None:
    stack = _stack()
    time = stack.covariate("time")
    along = (time - time.min()) / np.ptp(time)
    assert _drifting(np.sin(2.0 * np.pi * along)) < 0.05
    assert _drifting(np.cos(stack.run.astype(float))) < 1e-6
    assert _drifting(np.sin(50.0 * np.pi * along)) > 0.9


def test_only_zeros_are_free() -> None:
    free = {name: effect.free_along for name, effect in EFFECTS.items() if effect.free_along}
    assert free == {"sensor_drift": ("time", "run"), "sinkage_datum": ("run",)}
    assert all(EFFECTS[name].stage == "sensor" for name in free)


def test_an_effect_beside_others_that_run_away_has_no_other_forms(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The prediction without it is no number, and says nothing of what it adds."""
    problem = _problem()
    stack, effects = problem.stack, (EFFECTS["bulldozing"], EFFECTS["motor_heating"])
    free = free_of(effects)
    none = np.zeros(len(stack.rig.constants))
    fitted = problem.descend(effects, free, none, np.ones(len(free)), rounds=0)
    assert {f.name for f in form_errors(stack, problem.noise, fitted)} == {
        "bulldozing",
        "motor_heating",
    }

    monkeypatch.setattr(Stack, "predict", lambda *_: np.full(stack.size, np.nan))
    assert not form_errors(stack, problem.noise, fitted)


@pytest.mark.parametrize(("name", "slips"), [("shear_peak", True), ("bulldozing", False)])
def test_another_law_of_shear_may_act_as_a_change_of_slip(name: str, slips: bool) -> None:
    """What a pulley that slips does to all channels is a combination of the columns of a shear
    effect, but not of those of bulldozing.
    """
    problem = _problem()
    stack, effect = problem.stack, EFFECTS[name]
    free, still = free_of((effect,)), np.zeros(len(stack.rig.constants))
    fitted = problem.descend((effect,), free, still, np.ones(len(free)), rounds=0)
    *_, term = form_errors(stack, problem.noise, fitted)

    names = [constant.name for constant in stack.rig.constants]
    slipping = fitted.raw[:, names.index(stack.rig.slipping)]
    every = np.column_stack((term.columns.dense, fitted.raw[:, len(fitted.u) :]))
    left = slipping - every @ np.linalg.lstsq(every, slipping, rcond=None)[0]
    taken = np.linalg.norm(left) < 1e-6 * np.linalg.norm(slipping)
    assert taken == slips


@pytest.mark.parametrize(
    ("name", "placed"),
    [
        ("side_wall_rubbing", True),
        ("bulldozing", True),
        ("viscous_friction", False),
        ("torque_constant_error", False),
    ],
)
def test_what_a_drive_does_knows_of_no_place_on_the_bed(name: str, placed: bool) -> None:
    """An effect that is three tenths stronger and weaker along the bed, ten times on it, is within
    its term to vary along the place; a friction of the drive is not, nor a motor's constant.
    """
    problem = _problem()
    stack, effect = problem.stack, EFFECTS[name]
    free, still = free_of((effect,)), np.zeros(len(stack.rig.constants))
    fitted = problem.descend((effect,), free, still, np.ones(len(free)), rounds=0)
    terms = form_errors(stack, problem.noise, fitted)
    assert len(terms) == (2 if placed else 1)

    place = stack.covariate("position")
    along = (place - place.min()) / np.ptp(place)
    added = fitted.predicted - stack.predict(still, ())
    wavy = 0.3 * added * np.cos(20.0 * np.pi * along)
    every = np.column_stack([*(f.columns.dense for f in terms), fitted.raw[:, len(still) :]])
    left = wavy - every @ np.linalg.lstsq(every, wavy, rcond=None)[0]
    assert (np.linalg.norm(left) < 1e-6 * np.linalg.norm(wavy)) == placed


@pytest.mark.parametrize(
    "names",
    [
        ("rear_contact", "torque_constant_error"),
        ("rim_friction", "slip_sinkage"),
        ("sidewall_friction", "rear_contact"),
    ],
)
def test_other_forms_of_an_effect_are_shares_of_what_it_does(names: tuple[str, ...]) -> None:
    """On a patch that neither is. An effect that a fit leaves does not explain it by other forms of
    what it did where the fit began.
    """
    problem, effects = _problem_of_a_patch(), tuple(EFFECTS[name] for name in names)
    free, still = free_of(effects), np.zeros(len(problem.stack.rig.constants))
    model = fit_model(problem, (), effects, free, (still, np.ones(len(free))), ())
    assert model.marginal is not None
    for number, name in enumerate(model.names):
        added = added_by(problem.stack, model.fitted, number)
        does = np.linalg.norm(whiten(problem.noise, added[:, None]))
        terms = (term for term in model.marginal.terms if term.name == name)
        assert all(np.sqrt(np.trace(term.whitened.gram)) < 8.0 * does for term in terms)


@cache
def _problem_of_a_patch() -> Problem:
    change = {"cohesion_change": 0.4, "friction_change": 0.4, "centre": 0.5, "length": 0.2}
    runs = record(plan(LOADS[:2], 30.0, wrench=False), (make("soil_patch", change),))
    return fit_base(wheel_rig(runs, settings())).problem


@dataclass(frozen=True)
class _WavyWall(SideWallRubbing):
    """A wall that is not straight, with a wave each 12 cm."""

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        wave = 1.0 + 0.4 * np.cos(2.0 * np.pi * situation.position / 0.12)
        lost = self.share * wave * situation.carried * situation.direction
        return replace(reaction, drawbar_pull=reaction.drawbar_pull - lost)


def test_a_wall_that_is_not_straight_resembles_a_wall() -> None:
    """Its law would have to be bent by more than a law may be: it is likeliest, and no name."""
    found = diagnosed(plan(seconds=30.0), (_WavyWall(0.12),))
    assert found.hypotheses[0].effect == "side_wall_rubbing"
    assert "side_wall_rubbing" in found.summary and not found.accepted


@dataclass(frozen=True)
class _KeyedHub(HubRunout):
    """A hub that lifts the potentiometer over two fifths of a turn only, by 1 mm."""

    def _lift(self, angle: Scalar) -> Scalar:
        turned = np.mod(angle, 2.0 * np.pi) / (2.0 * np.pi)
        return 0.5e-3 * np.where(turned < 0.4, 1.0 - np.cos(5.0 * np.pi * turned), 0.0)


def test_a_hub_of_any_profile_takes_the_misfit() -> None:
    """What it does beyond one cycle a turn is its own, not something else that resembles a hub."""
    found = diagnosed(plan(seconds=60.0), (_KeyedHub(1.0),))
    (hub,) = found.accepted
    assert hub.effect == "hub_runout" and found.share > 0.9
    assert list(hub.profile) == ["sinkage"]
    assert hub.profile["sinkage"].value == pytest.approx(1e-3, rel=0.1)
    assert found.remaining["sinkage"].rms < 0.03e-3


def test_no_law_says_what_profile_a_hub_has() -> None:
    """Its third harmonic, as large as the first, is a combination of the columns with another of
    its profiles; what goes on evenly has no harmonics.
    """
    problem = _problem()
    stack, free = problem.stack, free_of((EFFECTS["hub_runout"],))
    x = np.array([1.0 if f.parameter.name == "lift_cos" else 0.0 for f in free])
    start = np.zeros(len(stack.rig.constants)), x
    fitted = problem.descend((EFFECTS["hub_runout"],), free, *start, rounds=0)
    profiles = [
        f
        for f in form_errors(stack, problem.noise, fitted)
        if f.columns.count == 2 * TUNING.fit.harmonics
    ]
    assert [f.sizes.values[-1] for f in profiles] == [2.0]

    added = fitted.predicted - stack.predict(start[0], ())
    third = np.abs(added).max() * np.cos(3.0 * stack.covariate("wheel_angle")) * (added != 0.0)
    columns = np.column_stack((profiles[0].columns.dense, fitted.raw[:, len(start[0]) :]))
    left = third - columns @ np.linalg.lstsq(columns, third, rcond=None)[0]
    assert np.linalg.norm(left) < 0.15 * np.linalg.norm(third)


def test_a_steady_effect_has_no_profile() -> None:
    problem = _problem()
    stack, free = problem.stack, free_of((EFFECTS["bulldozing"],))
    start = np.zeros(len(stack.rig.constants)), np.ones(len(free))
    fitted = problem.descend((EFFECTS["bulldozing"],), free, *start, rounds=0)
    terms = form_errors(stack, problem.noise, fitted)
    assert all(f.sizes.values[-1] < 2.0 for f in terms)


def test_what_a_reference_shows_has_the_other_forms_of_the_same_effect_that_is_new() -> None:
    effect = EFFECTS["bulldozing"]
    free = free_of((effect,))
    plain = _problem()
    constants = np.zeros(len(plain.stack.rig.constants))
    as_new = plain.descend((effect,), free, constants, np.ones(len(free)), rounds=0)

    shown = {f.parameter.name: Uncertain(f.value(1.0), f.parameter.sigma) for f in free}
    rig = plain.stack.rig.having((ConfiguredEffect("bulldozing", shown),))
    had = Problem(Stack(rig), plain.noise, plain.fixed[0].columns.dense)
    as_had = had.descend((), (), np.zeros(len(rig.constants)), np.zeros(0), rounds=0)
    np.testing.assert_allclose(as_had.predicted, as_new.predicted, rtol=1e-6, atol=1e-6)

    ours = form_errors(plain.stack, plain.noise, as_new)
    theirs = baseline_terms(had.stack, had.noise, as_had)
    assert [f.name for f in theirs] == [f.name for f in ours]
    for one, other in zip(ours, theirs, strict=True):
        assert one.sizes == other.sizes and one.least == other.least
        scale = np.linalg.norm(one.columns.dense)
        np.testing.assert_allclose(other.columns.dense, one.columns.dense, atol=1e-4 * scale)


def test_a_rig_without_a_reference_has_none_of_it() -> None:
    problem = _problem()
    none = np.zeros(len(problem.stack.rig.constants))
    fitted = problem.descend((), (), none, np.zeros(0), rounds=0)
    assert baseline_terms(problem.stack, problem.noise, fitted) == ()
