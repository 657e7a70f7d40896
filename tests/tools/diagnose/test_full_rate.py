"""What is faster than the grid: named where it is there, and not seen where it is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gritd
from gritd.estimator.effects import make
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.fit.shared import rippling_columns
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.adapter import rig_of as recorded_rig
from gritd.tools.diagnose.rig.full_rate import beside_lines, restored
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import draw, record, record_fully, rig_of
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long


def _ripple(order: float) -> tuple[object, ...]:
    return (make("gear_ripple", {"ripple_cos": 0.1, "ripple_sin": 0.05, "order": order}),)


def test_no_campaign_with_nothing_in_it_has_a_line() -> None:
    """Noise of any size and colour, testbeds and schedules of any kind."""
    for seed in range(12):
        made = record_fully(draw(settings(), np.random.default_rng((seed, 99))), ())
        signals, full = zip(*made, strict=True)
        reads = [lambda read=read: read for read in full]
        assert beside_lines(signals, reads, 1.0)[1].every == (), seed


def test_steps_of_the_load_are_no_ripple(tmp_path: Path) -> None:
    """The packaged schedule changes the load while the wheel drives on, alike in every run."""
    paths = [tmp_path / f"run-{seed}.mcap" for seed in (11, 12, 13)]
    for seed, path in zip((11, 12, 13), paths, strict=True):
        gritd.simulate(seed=seed).write(path)
    assert recorded_rig(read_all(paths), settings())[0].lines.every == ()


@pytest.mark.parametrize("order", [37.0, 73.0])
def test_the_count_of_a_gears_teeth_comes_from_the_full_rate(order: float) -> None:
    rig = rig_of(plan(), _ripple(order))  # type: ignore[arg-type]
    assert rig.lines.orders(2.0, 200.0) == [pytest.approx(order, abs=0.05)]
    (line,) = rig.lines.new
    assert line.channel == "torque"
    assert line.size == pytest.approx(np.hypot(0.1, 0.05), rel=0.02)


def test_the_grid_holds_a_fast_ripple_with_its_size() -> None:
    made = record_fully(plan(loads=(70.0,)), _ripple(73.0))  # type: ignore[arg-type]
    ((means, full),) = made
    (whole,), lines = beside_lines([means], [lambda: full], 1.0)

    driven = np.abs(whole.wheel_speed) > 0.1
    wave = 0.05 * np.cos(73.0 * whole.wheel_angle) + 0.025 * np.sin(73.0 * whole.wheel_angle)
    added = whole.analogue["current"] - means.analogue["current"]
    damping = np.sinc(73.0 * means.wheel_speed / (20.0 * np.pi))
    missing = wave * (1.0 - damping)
    steady = driven & (np.abs(np.gradient(means.wheel_speed)) < 1e-3)
    assert np.corrcoef(added[steady], missing[steady])[0, 1] > 0.95
    np.testing.assert_array_equal(restored(means, full, lines).time, means.time)


def test_a_table_of_steady_states_has_no_lines() -> None:
    made = record_fully(plan(loads=(70.0,)), _ripple(73.0))  # type: ignore[arg-type]
    ((means, full),) = made
    table = replace(means, info=replace(means.info, steady_states=True))
    assert beside_lines([table], [lambda: full], 1.0)[1].every == ()


def test_a_ripple_of_the_reference_goes_on_with_its_exact_order() -> None:
    """67.1 a turn lies between the orders that are tried on the grid."""
    ripple, still = _ripple(67.1), plan(seed=5, standstill=False)
    before = record_fully(still, ripple)  # type: ignore[arg-type]
    rig = rig_of(plan(seed=6, standstill=False), ripple, before, "same")  # type: ignore[arg-type]
    assert rig.lines.new and rig.lines.orders(2.0, 200.0) == []

    stack = Stack(rig)
    smooth = Stack(wheel_rig([*record(still, ())] * 2, settings(), 3, "same", lines=rig.lines))
    residual = stack.measured - smooth.measured
    torque = stack.of("torque") & (stack.covariate("speed") > 0.0)
    columns, rippling = rippling_columns(stack)[torque], residual[torque]
    left = rippling - columns @ np.linalg.lstsq(columns, rippling, rcond=None)[0]
    assert np.std(left) < 0.1 * np.std(rippling)


def _diagnosed(acting: tuple[object, ...], seconds: float = 16.0) -> Diagnosis:
    return diagnose(rig_of(plan(seconds=seconds), acting), quick=True)  # type: ignore[arg-type]


@pytest.mark.long
@pytest.mark.parametrize("order", [50.0, 73.0])
def test_a_gear_that_the_grid_does_not_hold_is_named(order: float) -> None:
    """At 73 a turn the grid alone names an offset of the current."""
    found = _diagnosed(_ripple(order))
    assert [h.effect for h in found.accepted] == ["gear_ripple"]
    known = found.accepted[0].parameters
    assert known["order"].value == pytest.approx(order, abs=0.05)
    assert known["ripple_cos"].value == pytest.approx(0.1, abs=0.01)
    assert known["ripple_sin"].value == pytest.approx(0.05, abs=0.01)
    assert not any("ripple" in note for note in found.caveats)
    assert [line.at for line in found.lines] == [pytest.approx(order, abs=0.05)]


@pytest.mark.long
def test_a_gear_is_named_where_the_encoder_begins_anew_each_run() -> None:
    made = record_fully(plan(), _ripple(50.0))  # type: ignore[arg-type]
    turned = []
    for number, (known, full) in enumerate(made):
        zero = 0.9 * number
        time, angle = full["wheel_encoder"]
        full = {**full, "wheel_encoder": (time, angle + zero)}
        turned.append((replace(known, wheel_angle=known.wheel_angle + zero), full))

    signals, reads = zip(*turned, strict=True)
    beside, lines = beside_lines(signals, [lambda read=read: read for read in reads], 2.0)
    found = diagnose(wheel_rig(beside, settings(), lines=lines), quick=True)
    assert [h.effect for h in found.accepted] == ["gear_ripple"]
    assert any("begins at other angles" in note for note in found.caveats)


@pytest.mark.long
def test_a_hub_that_lifts_the_potentiometer_is_named() -> None:
    """Three turns a run: too few for a line, which the grid holds."""
    found = _diagnosed((make("hub_runout", {"lift_cos": 5e-4, "lift_sin": 5e-4}),), 60.0)
    assert [h.effect for h in found.accepted] == ["hub_runout"]
