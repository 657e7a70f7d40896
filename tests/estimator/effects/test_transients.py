"""What follows over a length of travel, starts from rest, or turns round."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config import configuration
from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.history import followed, relaxed
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.campaign import Campaign, Driven
from gritd.tools.testbed.fingerprints import SOIL, WHEEL, campaign, typical

RATE = 50.0  # [Hz]
# of one length, and from nought where the wheel stops or turns round
LAGS = {"forces": 1.0, "sinkage": 1.0, "longer": 0.0, "kept": 0.0}
ALONE = [n for n, e in EFFECTS.items() if not e.filter_only and not e.by_run]


def driven(load: Array, slip: Array, speed: Array) -> Motion:
    """A motion at RATE; arrays (n,): weights [N], slip, wheel speed [rad/s]."""
    travel = WHEEL.radius * speed * (1.0 - slip)
    return Motion(
        time=np.arange(load.size) / RATE,
        wheel_angle=np.cumsum(speed) / RATE,
        wheel_speed=speed,
        carriage_position=np.cumsum(travel) / RATE,
        carriage_speed=travel,
        load=load,
    )


def stepped(before: float, after: float, n: int = 1000) -> Array:
    return np.where(np.arange(n) < n // 4, before, after)


def path(motion: Motion, share: float = 0.5) -> Array:
    """Mean of the ways of rim (its share) and axle since the quarter [m]."""
    rim = WHEEL.radius * np.asarray(motion.wheel_angle)
    mean = share * rim + (1.0 - share) * np.asarray(motion.carriage_position)
    return mean - mean[np.size(mean) // 4 - 1]


@pytest.mark.parametrize("speed", [0.1, 0.4])
@pytest.mark.parametrize("channel", ["torque", "drawbar_pull", "sinkage"])
def test_a_step_is_followed_over_the_relaxation_length_at_any_speed(
    channel: str, speed: float
) -> None:
    motion = driven(stepped(40.0, 90.0), stepped(0.1, 0.5), np.full(1000, speed))
    plain = getattr(simulate_arrays(WHEEL, SOIL, motion), channel)
    lagging = make("contact_relaxation", {**LAGS, "length": 0.03})
    found = getattr(simulate_arrays(WHEEL, SOIL, motion, (lagging,)), channel)

    np.testing.assert_allclose(found[:250], plain[:250], rtol=1e-12)
    expected = plain[-1] + (plain[0] - plain[-1]) * np.exp(-path(motion) / 0.03)
    np.testing.assert_allclose(found[250:], expected[250:], rtol=1e-9)


@pytest.mark.parametrize("rim", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("channel", "times"), [("drawbar_pull", 1.0), ("sinkage", 1.8)])
def test_sinkage_has_a_length_of_its_own_and_the_path_is_that_of_rim_or_axle(
    channel: str, times: float, rim: float
) -> None:
    motion = driven(stepped(60.0, 60.0), stepped(0.1, 0.6), np.full(1000, 0.2))
    plain = getattr(simulate_arrays(WHEEL, SOIL, motion), channel)
    shapes = {"length": 0.03, "deeper": 1.8, "rim": rim}
    lagging = make("contact_relaxation", {**LAGS, **shapes})
    found = getattr(simulate_arrays(WHEEL, SOIL, motion, (lagging,)), channel)

    way = path(motion, rim) / (0.03 * times)
    expected = plain[-1] + (plain[0] - plain[-1]) * np.exp(-way)
    np.testing.assert_allclose(found[250:], expected[250:], rtol=1e-9)


@pytest.mark.parametrize("name", list(EFFECTS))
def test_a_speed_that_does_not_vary_may_be_one_number(name: str) -> None:
    motion = driven(stepped(40.0, 90.0), np.full(1000, 0.2), np.full(1000, 0.3))
    travel = float(np.ravel(motion.carriage_speed)[0])
    steady = replace(motion, wheel_speed=0.3, carriage_speed=travel)
    found, alike = (
        simulate_arrays(WHEEL, SOIL, m, (typical(EFFECTS[name]),)) for m in (motion, steady)
    )
    np.testing.assert_allclose(alike.sensed.current, found.sensed.current, rtol=1e-9)
    np.testing.assert_allclose(alike.sensed.drawbar_pull, found.sensed.drawbar_pull, rtol=1e-9)
    np.testing.assert_allclose(alike.sensed.sinkage, found.sensed.sinkage, rtol=1e-9)


def test_the_load_is_carried_at_once() -> None:
    motion = driven(stepped(40.0, 90.0), np.full(1000, 0.2), np.full(1000, 0.3))
    found = simulate_arrays(WHEEL, SOIL, motion, (typical(EFFECTS["contact_relaxation"]),))
    np.testing.assert_allclose(found.load, motion.load, rtol=1e-8)


def test_a_wheel_at_rest_keeps_its_sinkage_and_feels_no_torque() -> None:
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.5), stepped(0.3, 0.0))
    found = simulate_arrays(WHEEL, SOIL, motion, (typical(EFFECTS["contact_relaxation"]),))
    np.testing.assert_allclose(found.sinkage[251:], found.sinkage[250], rtol=1e-9)
    np.testing.assert_allclose(found.torque[251:], 0.0, atol=1e-9)


@pytest.mark.parametrize("kept", [0.0, 1.0])
def test_a_wheel_that_touches_down_begins_anew(kept: float) -> None:
    """Off the ground nothing is remembered of what was before."""
    load = np.concatenate((np.full(300, 80.0), np.zeros(100), np.full(600, 30.0)))
    motion = driven(load, np.full(1000, 0.3), np.full(1000, 0.3))
    lagging = make("contact_relaxation", {**LAGS, "kept": kept})
    found = simulate_arrays(WHEEL, SOIL, motion, (lagging,))
    plain = simulate_arrays(WHEEL, SOIL, motion)
    np.testing.assert_array_equal(found.torque[300:400], 0.0)
    assert np.all(np.diff(found.torque[400:]) > -1e-12)
    assert found.torque[400] < 0.3 * plain.torque[400]
    assert found.torque[-1] == pytest.approx(plain.torque[-1], rel=1e-3)


@pytest.mark.parametrize(("kept", "shares"), [(0.0, [0.1, 0.63, 0.99]), (1.0, [1.0, 1.0, 1.0])])
def test_a_run_that_starts_from_rest_builds_its_torque_up_or_has_kept_it(
    kept: float, shares: list[float]
) -> None:
    speed = stepped(0.0, 0.3)
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.3), speed)
    lagging = make("contact_relaxation", {**LAGS, "kept": kept})
    found = simulate_arrays(WHEEL, SOIL, motion, (lagging,))
    steady = simulate_arrays(WHEEL, SOIL, motion).torque[-1]
    after = found.torque[250 + np.searchsorted(path(motion)[250:], [0.003, 0.03, 0.15])]
    np.testing.assert_allclose(after / steady, shares, atol=0.02)


def test_a_torque_that_keeps_its_size_turns_round_with_the_wheel() -> None:
    speed = stepped(0.3, -0.3)
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.3), speed)
    plain = simulate_arrays(WHEEL, SOIL, motion).torque
    lagging = [make("contact_relaxation", {**LAGS, "kept": kept}) for kept in (0.0, 0.5, 1.0)]
    signed, half, sized = (simulate_arrays(WHEEL, SOIL, motion, (one,)).torque for one in lagging)
    np.testing.assert_allclose(sized, plain, rtol=1e-9)
    assert signed[255] > 0.0 > plain[255]
    np.testing.assert_allclose(half, 0.5 * (signed + sized), atol=1e-9)


def test_the_length_goes_with_the_contact() -> None:
    ways = {}
    for load in (30.0, 120.0):
        motion = driven(np.full(1000, load), stepped(0.1, 0.5), np.full(1000, 0.2))
        plain = simulate_arrays(WHEEL, SOIL, motion)
        lagging = make("contact_relaxation", {**LAGS, "sinkage": 0.0, "longer": 1.0})
        found = simulate_arrays(WHEEL, SOIL, motion, (lagging,)).torque
        left = (found[260] - plain.torque[-1]) / (plain.torque[0] - plain.torque[-1])
        length = -(path(motion)[260] / np.log(left))
        entry = np.arccos(1.0 - plain.sinkage[260] / WHEEL.radius)
        ways[load] = length / np.sin(entry)
    assert ways[30.0] == pytest.approx(0.03 / 0.5, rel=1e-6)
    assert ways[120.0] == pytest.approx(ways[30.0], rel=1e-6)


def test_running_in_starts_shallow_with_more_torque() -> None:
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.3), np.full(1000, 0.3))
    starting = make("running_in", {"shallow": 0.35, "torque": 0.2, "length": 0.05})
    found, plain = (simulate_arrays(WHEEL, SOIL, motion, some) for some in ((starting,), ()))
    assert found.sinkage[0] / plain.sinkage[0] == pytest.approx(0.65, abs=0.01)
    assert found.torque[0] / plain.torque[0] == pytest.approx(1.2, abs=0.01)
    left = np.exp(-np.asarray(motion.carriage_position)[-1] / 0.05)
    assert found.sinkage[-1] / plain.sinkage[-1] == pytest.approx(1.0 - 0.35 * left)


@pytest.mark.parametrize(
    ("order", "gone"),
    [(0.0, lambda x: 1.0 - (1.0 - np.exp(-1.0)) * x), (2.0, lambda x: 1.0 / (1.0 + 1.718282 * x))],
)
def test_running_in_is_a_straight_line_or_a_hyperbola_by_its_order(
    order: float, gone: Callable[[Array], Array]
) -> None:
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.3), np.full(1000, 0.3))
    starting = make("running_in", {"shallow": 0.35, "length": 0.05, "order": order})
    found, plain = (simulate_arrays(WHEEL, SOIL, motion, some) for some in ((starting,), ()))
    left = np.maximum(gone(np.abs(np.asarray(motion.carriage_position)) / 0.05), 0.0)
    np.testing.assert_allclose(found.sinkage / plain.sinkage, 1.0 - 0.35 * left, atol=1e-6)


def test_what_the_rim_shears_more_at_the_start_it_also_pushes_with() -> None:
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.3), np.full(1000, 0.3))
    starting = make("running_in", {"torque": 0.2})
    found, plain = (simulate_arrays(WHEEL, SOIL, motion, some) for some in ((starting,), ()))
    more = found.drawbar_pull - plain.drawbar_pull
    np.testing.assert_allclose(more, (found.torque - plain.torque) / WHEEL.radius, rtol=1e-9)
    assert more[0] > 0.1


def test_the_motor_turns_freely_through_the_gap_after_each_reversal() -> None:
    speed = np.repeat([0.2, -0.2, 0.2, -0.2], 250)
    motion = driven(np.full(1000, 60.0), np.full(1000, 0.2), speed)
    plain = simulate_arrays(WHEEL, SOIL, motion)
    for gap in (0.03, 0.1):
        found = simulate_arrays(WHEEL, SOIL, motion, (make("backlash", {"gap": gap}),))
        missing = (plain.current - found.current) / plain.current * 0.2 / RATE
        for start in (250, 500, 750):
            assert missing[start : start + 250].sum() == pytest.approx(gap, rel=1e-6)
        np.testing.assert_array_equal(found.current[:250], plain.current[:250])
        np.testing.assert_array_equal(found.torque, plain.torque)


# ---- one array for all runs ----------------------------------------------------------------------


@pytest.mark.parametrize("name", ALONE)
@pytest.mark.long
def test_runs_in_one_array_do_not_touch(name: str) -> None:
    """A campaign in one call is what its runs are one by one."""
    settings = replace(configuration.load(packaged()).settings, wheel=WHEEL, effects=())
    motions = [replace(m, load=np.asarray(m.load)) for m in campaign(2, reversing=True)]
    effect, channels = typical(EFFECTS[name]), ("torque", "sinkage", "drawbar_pull", "load")
    ones = np.ones(sum(np.size(m.time) for m in motions))
    together = Campaign(motions, settings, channels, SOIL).readings(
        Driven(SOIL, ones, 1.0, (effect,))
    )
    apart = [
        Campaign([m], settings, channels, SOIL).readings(
            Driven(SOIL, np.ones(np.size(m.time)), 1.0, (effect,))
        )
        for m in motions
    ]
    np.testing.assert_allclose(together, np.hstack(apart), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("name", sorted(ALONE))
@pytest.mark.long
def test_readings_do_not_depend_on_what_was_read_before(name: str) -> None:
    """What the soil carries is solved once for all effects that do not bear on it."""
    settings = replace(configuration.load(packaged()).settings, wheel=WHEEL, effects=())
    motions = [replace(m, load=np.asarray(m.load)) for m in campaign(2, reversing=True)]
    channels = ("torque", "sinkage", "drawbar_pull", "load")
    ones = np.ones(sum(np.size(m.time) for m in motions))
    whole = Campaign(motions, settings, channels, SOIL)
    for before in ((), (typical(EFFECTS["slip_sinkage"]),), (typical(EFFECTS["sensor_drift"]),)):
        whole.readings(Driven(SOIL, ones, 1.0, before))

    driven = Driven(SOIL, ones, 1.0, (typical(EFFECTS[name]),))
    fresh = Campaign(motions, settings, channels, SOIL).readings(driven)
    found = whole.readings(driven)
    np.testing.assert_allclose(found, fresh, rtol=1e-8, atol=1e-9)


@given(st.integers(1, 70), st.integers(0, 2**32 - 1))
def test_following_is_the_recursion(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    target, share = rng.normal(size=count), rng.choice([0.0, 0.01, 0.5, 1.0], count)
    run = np.sort(rng.integers(0, 3, count)).astype(float)
    expected = np.empty(count)
    for n in range(count):
        begins = n == 0 or run[n] != run[n - 1]
        before = target[n] if begins else expected[n - 1]
        expected[n] = before + share[n] * (target[n] - before)
    np.testing.assert_allclose(followed(target, share, run), expected, atol=1e-12)


def test_relaxing_begins_at_nought_in_every_run() -> None:
    time = np.concatenate((np.arange(50) * 0.1, 100.0 + np.arange(50) * 0.1))
    run = np.repeat([0.0, 1.0], 50)
    found = relaxed(time, np.full(100, 3.0), 2.0, run)
    np.testing.assert_allclose(found[:50], 3.0 * -np.expm1(-time[:50] / 2.0), atol=1e-12)
    np.testing.assert_allclose(found[50:], found[:50], atol=1e-12)
