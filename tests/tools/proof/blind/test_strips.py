"""The bed of strips: mechanics that must hold, whatever its numbers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.tools.proof.blind.knowledge import FAMILIES
from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.respond import World, respond, responses
from gritd.tools.proof.blind.plant.scene import Felt, TrueMotion
from gritd.tools.proof.blind.plant.strips import StripBed
from tests.tools.proof.blind.scene import GROUND, RIG

pytestmark = pytest.mark.long

SPEED = 0.02  # of the rim [m/s]
WORLD = World(RIG, GROUND, bed=StripBed())


def steady(weight: float, slip: float, seconds: float = 12.0, way: float = 1.0) -> TrueMotion:
    """One load and slip, forward or (way = −1) backward, on fresh soil."""
    time = np.arange(0.0, seconds, 0.05)
    ones = np.ones(time.size)
    speed = way * SPEED * (1.0 - slip)
    return TrueMotion(
        time,
        way * SPEED / RIG.radius * time,
        way * SPEED / RIG.radius * ones,
        speed * time,
        speed * ones,
        weight * ones,
        1,
    )


def last(felt: Felt, name: str) -> float:
    """Mean over the last quarter, where the wheel has left its first contact."""
    values = getattr(felt, name)
    return float(values[3 * values.size // 4 :].mean())


@settings(max_examples=20)
@given(
    st.sampled_from(sorted(FAMILIES)),
    st.floats(0.2, 0.7),
    st.floats(-0.1, 0.9),
    st.sampled_from((1.0, -1.0)),
)
def test_everything_is_finite_and_costs_power(
    family: str, share: float, slip: float, way: float
) -> None:
    """What the soil takes from the motor is more than what it gives the carriage."""
    cohesion, phi, *others = FAMILIES[family]
    ground = PlantSoil(cohesion, float(np.tan(np.radians(phi))), *others)
    weight = share * RIG.radius * RIG.width * 2.0e4
    felt = respond(replace(WORLD, ground=ground), steady(weight, slip, way=way))
    for name in ("sinkage", "torque", "pull", "load", "current"):
        assert np.isfinite(getattr(felt, name)).all()
    motion = felt.scene.motion
    power = felt.torque * motion.omega - felt.pull * motion.speed
    assert power[power.size // 2 :].mean() > 0.0
    assert 0.0 < last(felt, "sinkage") < RIG.radius


def test_a_heavier_wheel_sinks_deeper_and_a_slipping_one_pulls_harder() -> None:
    by_load = responses([(WORLD, steady(weight, 0.2)) for weight in (20.0, 40.0, 80.0)])
    assert np.all(np.diff([last(felt, "sinkage") for felt in by_load]) > 1e-3)
    by_slip = responses([(WORLD, steady(50.0, slip, 20.0)) for slip in (0.05, 0.2, 0.4, 0.6)])
    assert np.all(np.diff([last(felt, "torque") for felt in by_slip]) > 0.05)
    assert np.all(np.diff([last(felt, "pull") for felt in by_slip]) > 0.5)


def test_stress_at_the_bottom_carries_the_wheel_higher_than_the_papers() -> None:
    strips, paper = (
        last(respond(World(RIG, GROUND, bed=bed), steady(50.0, 0.2)), "sinkage")
        for bed in (StripBed(), World(RIG, GROUND).bed)
    )
    assert 0.45 < strips / paper < 0.8


def test_torque_follows_slip_over_the_length_of_the_contact() -> None:
    motion = steady(50.0, 0.1, 40.0)
    slip = np.where(motion.time < 20.0, 0.1, 0.5)
    speed = SPEED * (1.0 - slip)
    travel = np.concatenate(([0.0], np.cumsum(0.05 * speed[1:])))
    felt = respond(WORLD, replace(motion, speed=speed, travel=travel))
    since = travel - np.interp(20.0, motion.time, travel)
    before, after = felt.torque[motion.time < 20.0][-1], last(felt, "torque")
    risen = (felt.torque - before) / (after - before)
    assert 0.02 < np.interp(0.004, since, risen) < 0.5
    assert np.interp(0.012, since, risen) < 0.95
    assert np.interp(0.045, since, risen) == pytest.approx(1.0, abs=0.05)


def test_a_rut_stays() -> None:
    """On the second pass the wheel finds its rut and presses it but a little deeper."""
    first, second = responses(
        [(WORLD, replace(steady(50.0, 0.2), passes=passes)) for passes in (1, 2)]
    )
    deeper = last(second, "sinkage") - last(first, "sinkage")
    assert 0.0 < deeper < 0.5 * last(first, "sinkage")
    resistance = [
        last(felt, "torque") / RIG.radius - last(felt, "pull") for felt in (first, second)
    ]
    assert 0.0 < resistance[1] < resistance[0]  # less soil to press down


def test_backward_is_forward_in_a_mirror() -> None:
    there, back = responses([(WORLD, steady(50.0, 0.2, way=way)) for way in (1.0, -1.0)])
    assert last(back, "sinkage") == pytest.approx(last(there, "sinkage"), rel=2e-3)
    assert last(back, "torque") == pytest.approx(-last(there, "torque"), rel=0.02)
    assert last(back, "pull") == pytest.approx(-last(there, "pull"), rel=0.04)


def test_lanes_do_not_touch_each_other() -> None:
    motions = [steady(30.0, 0.1), steady(90.0, 0.5, 7.0), replace(steady(50.0, 0.3), passes=2)]
    together = responses([(WORLD, motion) for motion in motions])
    for motion, felt in zip(motions, together, strict=True):
        alone = respond(WORLD, motion)
        np.testing.assert_allclose(felt.sinkage, alone.sinkage, rtol=1e-4)
        np.testing.assert_allclose(felt.torque, alone.torque, rtol=1e-3, atol=1e-3)


def test_finer_strips_and_steps_change_little() -> None:
    motion = steady(50.0, 0.3)
    coarse, fine = (
        respond(World(RIG, GROUND, bed=bed), motion)
        for bed in (StripBed(), StripBed(strips=96, step=0.0125))
    )
    for name, close in (("sinkage", 0.01), ("torque", 0.02), ("pull", 0.03)):
        assert last(coarse, name) == pytest.approx(last(fine, name), rel=close)


def test_a_lifted_wheel_feels_nothing_and_soil_does_not_lift_a_standing_one() -> None:
    motion = steady(50.0, 0.2)
    lifted = respond(WORLD, replace(motion, weight=np.where(motion.time > 6.0, 0.0, 50.0)))
    after = motion.time > 6.5
    assert np.all(lifted.torque[after] == 0.0) and np.all(lifted.pull[after] == 0.0)
    assert np.all(lifted.sinkage[after] < 0.0)

    stop = np.minimum(motion.time, 6.0)
    halted = replace(
        motion, turn=SPEED / RIG.radius * stop, travel=0.8 * SPEED * stop,
        omega=np.where(motion.time < 6.0, motion.omega, 0.0),
        speed=np.where(motion.time < 6.0, motion.speed, 0.0),
    )  # fmt: skip
    standing = respond(WORLD, halted).sinkage[motion.time > 6.2]
    assert np.ptp(standing) < 1e-5
