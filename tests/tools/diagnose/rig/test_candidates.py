"""A table of steady states holds no ripple, and no order of time and place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.effects import EFFECTS
from gritd.tools.diagnose.fit.functions import smooth_signatures
from gritd.tools.diagnose.fit.problem import free_of
from gritd.tools.diagnose.fit.shared import MEMORY, STARTS, shared_columns
from gritd.tools.diagnose.fit.signatures import highest_order
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def tabled(run: Signals) -> Signals:
    """The run as a table says it: silence wherever a speed is changing."""
    rates = np.gradient(run.wheel_speed, run.time), np.gradient(run.carriage_rate, run.time)
    changing = np.any([np.abs(r) > 0.1 * np.nanmax(np.abs(r)) for r in rates], axis=0)
    around = np.convolve(changing, np.ones(5), "same") > 0.0
    silent = np.where(around, np.nan, run.wheel_speed)
    return replace(run, wheel_speed=silent, info=replace(run.info, steady_states=True))


@pytest.fixture(scope="module")
def driven() -> list[Signals]:
    return record(plan(seconds=24.0, standstill=False), ())


def test_short_runs_at_steady_speeds_are_no_table(driven: list[Signals]) -> None:
    """They have times, places and wheel angles, so what goes with these may be what is left out."""
    short = [_steady(run) for run in driven]
    assert all(np.ptp(run.wheel_angle) < 2.0 * np.pi for run in short)
    listed = wheel_rig(short, settings()).effects
    assert {"bed_inclination", "soil_patch", "gear_ripple"} <= listed.keys()


def _steady(run: Signals) -> Signals:
    """Two seconds of a run at one speed."""
    at = slice(30, 50)
    names = ("time", "wheel_angle", "wheel_speed", "carriage_angle", "carriage_rate", "doubt")
    analogue = {name: values[at] for name, values in run.analogue.items()}
    return replace(run, analogue=analogue, **{name: getattr(run, name)[at] for name in names})


def test_the_scatter_of_a_table_is_no_sensors(driven: list[Signals]) -> None:
    """An importer drew it, so nothing is said of how loud it is."""
    assert wheel_rig(driven, settings()).stated_noise
    assert not wheel_rig([tabled(run) for run in driven], settings()).stated_noise


def test_a_driven_run_may_show_every_effect(driven: list[Signals]) -> None:
    rig = wheel_rig(driven, settings())
    listed = rig.effects
    assert not rig.tabled
    assert listed.keys() == {n for n, e in EFFECTS.items() if not e.filter_only} - {"empirical_law"}
    assert all(listed[name] is EFFECTS[name].without_side_force() for name in listed)


def test_a_table_shows_what_needs_neither_time_nor_place_nor_angle(driven: list[Signals]) -> None:
    rig = wheel_rig([tabled(run) for run in driven], settings())
    left = rig.effects
    assert rig.tabled
    gone = {"gear_ripple", "hub_runout", "soil_patch", "motor_heating", "contact_relaxation"}
    assert not gone & left.keys()
    assert {"slip_sinkage", "bulldozing", "coulomb_friction", "rim_friction"} <= left.keys()


def test_a_table_says_so_itself_however_far_its_wheel_turns(driven: list[Signals]) -> None:
    """Its scatter was drawn by an importer: trends, places and ripples of it are nobody's."""
    shown = [replace(run, info=replace(run.info, steady_states=True)) for run in driven]
    rig, as_driven = wheel_rig(shown, settings()), wheel_rig(driven, settings())
    assert "gear_ripple" in as_driven.effects and "gear_ripple" not in rig.effects
    assert highest_order(as_driven) > 0.0 == highest_order(rig)
    along = {along for s in smooth_signatures(Stack(rig)) for along in s.shape.along}
    assert {"slip", "load"} <= along
    assert not {"time", "position", "heat", "wheel_angle", "acceleration"} & along


def test_a_steady_state_began_long_ago(driven: list[Signals]) -> None:
    """Its slip, load and speed are as they were recorded. Nothing is left of a start or of an
    earlier slip, nothing is remembered, and no state has what a run begins with for itself.
    """
    shown = [replace(run, info=replace(run.info, steady_states=True)) for run in driven]
    rig, as_driven = wheel_rig(shown, settings()), wheel_rig(driven, settings())
    for own, other in zip(rig.forms, as_driven.forms, strict=True):
        np.testing.assert_array_equal(own.conditions[0][:, :4], other.conditions[0][:, :4])
        assert not own.conditions[0][:, 4:].any()
        assert other.conditions[0][:, 4:].any()

    stack = Stack(rig)
    u = np.zeros(len(rig.constants))
    shared = shared_columns(stack, u, stack.predict(u))
    assert not shared[STARTS].any() and not shared[MEMORY].any()


def test_lugs_dig_and_grip_in_a_table_without_a_count(driven: list[Signals]) -> None:
    rig = wheel_rig([tabled(run) for run in driven], settings())
    free = [f.parameter.name for f in free_of((rig.effects["grousers"],))]
    assert free == ["height", "grip", "digging", "share"]
    lugs = rig.effects["grousers"](digging=5e-3)
    without = rig.predict(np.zeros(len(rig.constants)), ())
    dug = rig.predict(np.zeros(len(rig.constants)), (lugs,))
    assert all(
        np.max(b["sinkage"] - a["sinkage"]) > 1e-3 for a, b in zip(without, dug, strict=True)
    )
