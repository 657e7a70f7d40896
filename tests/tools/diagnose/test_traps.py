"""The traps that were measured, each a test, on small campaigns with a known truth."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest

from gritd.estimator.config import configuration as config
from gritd.estimator.effects import make
from gritd.tools.diagnose.explain.apply import applied
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.fit import heldout
from gritd.tools.diagnose.method import diagnose, fit_base
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import begin
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import diagnosed, group, plan, settings, soil
from tests.tools.diagnose.unlisted import BentRail, CableChainDrag, NextDoor, ShearBands


def frees_the_soil(found: Diagnosis) -> bool:
    """Whether c and tan φ are within 2σ of the soil's once the effect is named."""
    assert found.soil is not None
    after, true = found.soil.after, {"c": soil().cohesion, "tan_phi": soil().tan_phi}
    return all(abs(after[name].value - true[name]) < 2.0 * after[name].sigma for name in true)


def test_a_friction_is_named_and_frees_the_soil() -> None:
    """Torque lost in the drivetrain passes for cohesion until it is named; held-out errors fall."""
    found = diagnosed(plan(), (make("coulomb_friction", {"loss": 0.25}),))
    assert found.verdict == "explained"
    assert "coulomb_friction" in group(found)
    assert found.soil is not None
    before = found.soil.before["c"]
    assert abs(before.value - soil().cohesion) > 2.0 * before.sigma
    assert frees_the_soil(found)
    assert found.fit.after["torque"] < 0.5 * found.fit.before["torque"]
    assert found.location[0].channel == "torque"
    assert json.loads(json.dumps(found.to_json(), allow_nan=False))["verdict"] == "explained"


def test_a_quiet_rig_gives_no_alarm() -> None:
    assert diagnosed(plan()).verdict == "consistent"


@pytest.mark.long
@pytest.mark.first
@pytest.mark.parametrize(
    ("slow_time", "seeds", "allowed"),
    [
        *((slow_time, 10, 0) for slow_time in (0.3, 1.0, 3.0)),
        *(
            pytest.param(t, 20, n, marks=pytest.mark.slow)
            for t, n in ((0.3, 0), (1.0, 1), (3.0, 1))
        ),
    ],
)
def test_coloured_noise_of_unknown_size_gives_no_alarm(
    slow_time: float, seeds: int, allowed: int
) -> None:
    """iid tests cry wolf; the configured noise is half or twice the true one. None of 60 campaigns
    alarms; of 120 2 % may, none in noise that is soon forgotten.
    """
    alarms = []
    for noise, seed in product((0.5, 2.0), range(1, seeds + 1)):
        drawn = plan(slow=0.3, slow_time=slow_time, noise=noise, seed=seed)
        screened = prepare_screening(fit_base(wheel_rig(record(drawn, ()), drawn.settings)))
        if begin(screened).first.alarmed:  # the verdict follows from it
            alarms.append((noise, seed))
    assert len(alarms) <= allowed, alarms


def test_what_the_soil_absorbs_shows_as_strain() -> None:
    """A rear contact hides in c: named from the strain against the prior, and c comes back."""
    found = diagnosed(
        plan(loads=(35.0, 60.0, 80.0, 105.0)), (make("rear_contact", {"ratio": 0.25}),)
    )
    assert "rear_contact" in group(found), found.summary
    assert frees_the_soil(found)


def test_without_standstill_offset_and_friction_are_one_group() -> None:
    found = diagnosed(plan(standstill=False), (make("coulomb_friction", {"loss": 0.25}),))
    assert {"coulomb_friction", "current_offset"} <= group(found)
    assert found.next_experiment is not None
    assert found.next_experiment.key in ("standstill", "lifted_spin", "reversal")


def test_slope_and_crosstalk_are_one_group() -> None:
    found = diagnosed(plan(), (make("bed_slope", {"angle": 0.03}),))
    assert {"bed_slope", "force_crosstalk"} <= group(found)


@pytest.mark.parametrize("stranger", [BentRail(size=1e-3), CableChainDrag(size=8.0)])
def test_a_stranger_is_not_given_a_listed_name(stranger: BentRail | CableChainDrag) -> None:
    found = diagnosed(plan(), (stranger,))
    assert found.verdict == "unlisted", found.summary
    assert max(h.probability for h in found.hypotheses) <= 0.5


@pytest.mark.parametrize("stranger", [CableChainDrag(size=20.0), NextDoor(size=10.0)])
def test_a_friction_is_named_beside_a_larger_stranger_elsewhere(
    stranger: CableChainDrag | NextDoor,
) -> None:
    """What pulls at the carriage is nothing against a loss that takes all that is wrong with the
    torque.
    """
    found = diagnosed(plan(), (make("coulomb_friction", {"loss": 0.06}), stranger))
    assert "coulomb_friction" in group(found), found.summary
    assert len([h for h in found.hypotheses if h.accepted]) == 1
    assert found.remaining_words


def test_a_wave_along_the_way_that_the_rim_slides_is_no_noise() -> None:
    found = diagnosed(plan(), (ShearBands(size=1.5),))
    assert found.verdict == "unlisted", found.summary
    first = found.location[0]
    assert (first.channel, first.covariate) == ("drawbar_pull", "sliding")
    assert "15" in first.where


def test_no_force_sensor_degrades_honestly() -> None:
    """What shows in the drawbar pull alone cannot show; no other name is given."""
    found = diagnosed(plan(wrench=False), (make("side_wall_rubbing", {"share": 0.04}),))
    assert found.verdict in ("consistent", "insufficient")
    assert any("No force sensor" in c for c in found.caveats)


def test_repeats_do_not_leak() -> None:
    """Whole runs, and whole loads and slip bands, are held out."""
    stack = Stack(wheel_rig(record(plan(), ()), settings()))
    assert [set(stack.run[f]) for f in heldout.run_folds(stack)] == [{0}, {1}, {2}]
    load = stack.covariate("load")
    for fold in heldout.condition_folds(stack)[:3]:
        assert not set(np.round(load[fold])) & set(np.round(load[~fold]))


def test_an_applied_effect_is_the_next_baseline() -> None:
    """After --apply the same testbed is consistent, and something new on top of it is what is
    named.
    """
    friction = make("viscous_friction", {"damping": 0.8})
    found = diagnosed(plan(), (friction,))
    document = config.load("config/testbed.yaml")
    text = applied(document, found)
    calibrated = config.loads(text, "new.yaml").settings
    again = plan(seed=5)
    rig = wheel_rig(record(again, (friction,)), calibrated)
    assert diagnose(rig).verdict == "consistent"
    new = diagnose(
        wheel_rig(record(again, (friction, make("slip_sinkage", {"growth": 0.1}))), calibrated)
    )
    assert [h.effect for h in new.accepted] == ["slip_sinkage"]
    assert "viscous_friction" in new.baseline
