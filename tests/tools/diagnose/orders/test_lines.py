"""Lines that stand out: what they are taken for, and what of them is new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.tools.diagnose.orders.campaigns import Lines, lines_of
from gritd.tools.diagnose.orders.lines import find_lines
from gritd.tools.diagnose.orders.on_grid import on_grid
from gritd.tools.diagnose.orders.stretches import TURN, GridMotion, Samples, steady_samples
from tests.tools.diagnose.orders.made import RATE, campaign, readings


def _runs(seed: int, count: int = 3, **how: tuple[float, ...]) -> list[Samples]:
    rng = np.random.default_rng(seed)
    return [readings(rng, **how) for _ in range(count)]  # type: ignore[arg-type]


@pytest.mark.parametrize("order", [37.0, 55.0, 74.0])
def test_a_ripple_is_found_at_its_order_with_its_size(order: float) -> None:
    (line,) = find_lines(campaign(_runs(1, ripple=(0.2, 0.1, order))))
    assert line.axis == "angle"
    assert abs(line.at - order) < 4.0 * line.sigma
    assert abs(line.size - np.hypot(0.2, 0.1)) < 4.0 * line.size_sigma
    assert line.p < 1e-6


def test_a_vibration_keeps_its_frequency_and_is_no_ripple() -> None:
    (line,) = find_lines(campaign(_runs(2, hum=(0.3, 7.3))))
    assert line.axis == "time"
    assert abs(line.at - 7.3) < 4.0 * line.sigma


def test_a_loud_ripple_brings_no_others() -> None:
    (line,) = find_lines(campaign(_runs(3, ripple=(30.0, 0.0, 60.0))))
    assert line.size == pytest.approx(30.0, rel=2e-3)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_loud_ripples_in_short_stretches_bring_no_others(seed: int) -> None:
    """Nine stretches of 4 s at one speed, a second apart: spectra have lines beside each line."""
    rng = np.random.default_rng(seed)
    begins = 5.0 * np.arange(9)
    time = (begins[:, None] + np.arange(0.0, 4.0, 1.0 / RATE)).ravel()
    number = np.repeat(np.arange(begins.size), time.size // begins.size)
    angle = 0.28 * time
    for ripples in ({23.0: 10.0}, {23.0: 10.0, 41.0: 2.0}, {60.0: 3.0, 90.0: 30.0}):
        values = rng.standard_normal(time.size)
        for order, size in ripples.items():
            values += size * np.cos(order * angle + 1.0)
        lines = find_lines(campaign([Samples(time, angle / TURN, values, number)]))
        assert {round(line.at): round(line.size) for line in lines} == ripples


def test_harmonics_are_told_and_support_a_count() -> None:
    def struck(seed: int, order: float, more: float) -> list[Samples]:
        out = []
        for made in _runs(seed, ripple=(0.3, 0.0, order)):
            out.append(made.with_values(made.values + more * np.cos(2 * order * TURN * made.angle)))
        return out

    lines = find_lines(campaign(struck(4, 30.0, 0.2)))
    assert [line.harmonic for line in lines] == [0.0, pytest.approx(30.0, abs=0.1)]
    (plain,) = find_lines(campaign(struck(4, 30.0, 0.0)))
    assert lines[0].support > plain.support + 10.0


def test_what_the_configuration_ripples_alike_is_not_new() -> None:
    lines = lines_of(campaign(_runs(6, ripple=(0.2, 0.0, 41.0))))
    assert [round(line.at) for line in lines.fresh()] == [41]
    assert replace(lines, configured=(41.0,)).fresh() == []
    assert [round(line.at) for line in replace(lines, configured=(40.0,)).fresh()] == [41]


def test_what_a_reference_ripples_alike_is_not_new() -> None:
    before = campaign(_runs(5, ripple=(0.2, 0.0, 41.0)))
    same = lines_of(campaign(_runs(6, ripple=(0.22, 0.0, 41.0))), before)
    assert same.new and same.fresh() == [] and same.orders(2.0, 200.0) == []
    other = lines_of(campaign(_runs(6, ripple=(0.2, 0.0, 63.0))), before)
    assert other.orders(2.0, 200.0) == [pytest.approx(63.0, abs=0.1)]
    louder = lines_of(campaign(_runs(6, ripple=(0.6, 0.0, 41.0))), before)
    assert louder.orders(2.0, 200.0) == [pytest.approx(41.0, abs=0.1)]
    assert louder.orders(2.0, 30.0) == []
    assert louder.shared(louder.new[0]) and not other.shared(other.new[0])


def test_what_a_short_reference_ripples_unnoticed_is_not_new() -> None:
    """A fifth of a turn holds eight of 41 ripples: too few to be found among all that are tried."""

    def after(ripple: float) -> Lines:
        rng = np.random.default_rng(7)
        short = campaign([readings(rng, ripple=(ripple, 0.0, 41.0), seconds=4.0)])
        return lines_of(campaign(_runs(6, ripple=(0.2, 0.0, 41.0))), short)

    held = after(0.2)
    assert held.reference == () and held.fresh() == [] and held.shared(held.new[0])
    assert [round(line.at) for line in after(0.0).fresh()] == [41]


def test_on_the_grid_a_ripple_stands_as_it_is_at_its_times() -> None:
    """73 ripples a turn at half a turn a second are 36 Hz; the grid has 10 Hz."""
    time = np.arange(0.0, 20.0, 1.0 / RATE)
    angle = 0.5 * TURN * time
    values = 3.0 + 0.4 * np.cos(73.0 * angle + 1.0)
    values = values + 0.01 * np.random.default_rng(8).standard_normal(time.size)
    middle = np.arange(0.05, 20.0, 0.1)
    motion = GridMotion(middle, np.full(middle.size, 0.5 * TURN), np.full(middle.size, 1.0))

    runs = [steady_samples(motion, (time, angle), {"torque": (time, values)})]
    lines = find_lines(runs)
    assert [round(line.at, 1) for line in lines] == [73.0]
    (_, left), ripple = on_grid(lines, motion, (time, angle), (time, values), middle)
    np.testing.assert_allclose(left, 3.0, atol=0.06)
    np.testing.assert_allclose(ripple, 0.4 * np.cos(73.0 * 0.5 * TURN * middle + 1.0), atol=0.02)


def test_a_wheel_that_stands_or_speeds_up_is_not_steady() -> None:
    middle = np.arange(0.05, 12.0, 0.1)
    speed = np.interp(middle, [0.0, 2.0, 2.5, 6.0, 7.0, 10.0, 10.2, 12.0], [0, 0, 1, 1, 2, 2, 0, 0])
    motion = GridMotion(middle, speed, speed)
    time = np.arange(0.0, 12.0, 1.0 / RATE)
    own = steady_samples(motion, (time, np.zeros(time.size)), {"load": (time, time)})["load"]
    spans = [(own.time[s][0], own.time[s][-1]) for s in own.slices]
    assert len(spans) == 2
    assert 2.5 < spans[0][0] < 3.4 and 5.4 < spans[0][1] < 6.0
    assert 7.0 < spans[1][0] < 7.6 and 8.9 < spans[1][1] < 10.0


def test_a_hub_that_lifts_once_a_turn_is_a_line_where_the_run_is_long() -> None:
    """Twelve turns; in sinkage alone."""
    rng = np.random.default_rng(9)
    run = {
        "sinkage": readings(rng, ripple=(0.2, 0.3, 1.0), seconds=300.0),
        "torque": readings(rng, seconds=300.0),
    }
    (line,) = find_lines([run])
    assert (line.channel, line.axis) == ("sinkage", "angle")
    assert abs(line.at - 1.0) < 4.0 * line.sigma
    assert line.size == pytest.approx(np.hypot(0.2, 0.3), rel=0.1)


def test_two_harmonics_propose_the_ripple_of_which_they_are() -> None:
    found = lines_of(campaign(_runs(6, ripple=(0.2, 0.0, 41.0))))
    (line,) = found.new
    third, fourth = (replace(line, at=at, support=50.0) for at in (18.04, 24.05))
    proposed = replace(found, new=(third, fourth)).orders(2.0, 200.0)
    assert proposed[:2] == [18.04, 24.05]
    assert any(order == pytest.approx(6.01, abs=0.01) for order in proposed)
    assert replace(found, new=(third, replace(fourth, at=29.3))).orders(2.0, 200.0)[2:] == []
