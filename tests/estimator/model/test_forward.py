"""The forward model: the balance against scipy, the inverse of the drivetrain, limits, and a wheel
that is bogged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, optimize

from gritd.estimator.compiled import balancing
from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.model import balance, forward
from gritd.estimator.model.balance import Contact
from gritd.estimator.stages.situation import (
    Balanced,
    Complete,
    ContactLaw,
    Motion,
    advanced,
    signed_slip,
    situation_of,
)
from gritd.estimator.terramechanics.original import forces
from gritd.estimator.terramechanics.soil import Soil, Wheel
from gritd.tools.testbed.fingerprints import SOIL, WHEEL, campaign, typical
from tests.rig import BALANCED

LOOSE = Soil(cohesion=700.0, tan_phi=0.6, shear_modulus=0.015, exponent=0.8, modulus=2.1e5)
BIG = Wheel(radius=0.15, width=0.15)


def load_by_quad(wheel: Wheel, soil: Soil, theta_1: float, slip: float) -> float:
    """W of Eq. (9) from Eqs. (3), (4), (7), written out and integrated by scipy."""
    theta_m = 0.5 * theta_1
    ratio = 1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip)

    def stress(theta: float) -> float:
        front = theta if theta >= theta_m else theta_1 - theta / theta_m * (theta_1 - theta_m)
        sigma = (
            soil.modulus
            * (wheel.radius * max(np.cos(front) - np.cos(theta_1), 0.0)) ** soil.exponent
        )
        j = wheel.radius * (theta_1 - theta - ratio * (np.sin(theta_1) - np.sin(theta)))
        tau = np.copysign(
            (soil.cohesion + sigma * soil.tan_phi) * (1.0 - np.exp(-abs(j) / soil.shear_modulus)), j
        )
        return float(tau * np.sin(theta) + sigma * np.cos(theta))

    zones = (
        integrate.quad(stress, a, b, epsabs=1e-9, epsrel=1e-9)[0]
        for a, b in ((0.0, theta_m), (theta_m, theta_1))
    )
    return wheel.radius * wheel.width * sum(zones)


def steady(
    load: float = 65.0, slip: float = 0.3, speed: float = 0.3, n: int = 50, **rest: object
) -> Motion:
    time = np.arange(n) / 25.0
    travel = (
        WHEEL.radius * speed * (1.0 - slip) if slip >= 0 else WHEEL.radius * speed / (1.0 + slip)
    )
    return Motion(
        time, speed * time, np.full(n, speed), travel * time, np.full(n, travel), load, **rest
    )  # type: ignore[arg-type]


@pytest.mark.parametrize(("wheel", "soil"), [(WHEEL, SOIL), (BIG, LOOSE)])
def test_balance_is_scipys(wheel: Wheel, soil: Soil) -> None:
    rng = np.random.default_rng(5)
    slip, load = rng.uniform(-0.1, 0.8, 12), rng.uniform(20.0, 90.0, 12)
    found = balance.solve(wheel, Contact(soil, ContactLaw(0.5), slip, load))
    for i, w, theta_1 in zip(slip, load, found.theta_1, strict=True):
        expected = optimize.brentq(
            lambda x, i=i, w=w: load_by_quad(wheel, soil, x, i) - w, 1e-3, 1.5, xtol=1e-13
        )
        assert theta_1 == pytest.approx(expected, rel=2e-7 if i >= 0.0 else 1e-5)


@given(
    cohesion=st.floats(0.0, 2e4),
    tan_phi=st.floats(0.05, 1.2),
    exponent=st.floats(0.4, 1.8),
    modulus=st.floats(4.0, 7.0),
    k=st.floats(2e-3, 0.1),
    slip=st.floats(-0.6, 1.0),
    load=st.floats(1.0, 200.0),
)
@settings(max_examples=150)
def test_balance_carries_the_load_or_says_so(
    cohesion: float,
    tan_phi: float,
    exponent: float,
    modulus: float,
    k: float,
    slip: float,
    load: float,
) -> None:
    soil = Soil(cohesion, tan_phi, k, exponent, 10.0**modulus)
    found = balance.solve(WHEEL, Contact(soil, ContactLaw(0.5), np.full(3, slip), np.full(3, load)))
    if found.overloaded.any():
        assert np.all(found.theta_1 == pytest.approx(balance.DEEPEST))
        assert np.all(found.forces.load < load)
    else:
        np.testing.assert_allclose(found.forces.load, load, rtol=2e-9)


@pytest.mark.parametrize(("slips", "error"), [((0.0, 0.9), 3e-7), ((-0.1, 0.0), 2e-5)])
def test_quadrature_error_is_as_stated(slips: tuple[float, float], error: float) -> None:
    rng = np.random.default_rng(6)
    theta_1, slip = rng.uniform(0.05, 1.4, 2000), rng.uniform(*slips, 2000)
    for wheel, soil in ((WHEEL, SOIL), (BIG, LOOSE)):
        few = forces(wheel, soil, theta_1, slip, order=balance.ORDER)
        many = forces(wheel, soil, theta_1, slip, order=100)
        assert np.max(np.abs(few.load - many.load) / many.load) < error
        assert np.max(np.abs(few.drawbar_pull - many.drawbar_pull) / many.load) < error
        assert np.max(np.abs(few.torque - many.torque) / (wheel.radius * many.load)) < error


def test_warm_start_finds_the_same_balance() -> None:
    slip, load = np.linspace(0.0, 0.8, 40), np.linspace(20.0, 100.0, 40)
    cold = balance.solve(WHEEL, Contact(SOIL, ContactLaw(0.5), slip, load))
    far = cold._replace(theta_1=0.5 * cold.theta_1 + 0.3, slope=np.full(40, 3.0))
    warm = balance.solve(WHEEL, Contact(SOIL, ContactLaw(0.5), slip, load), far)
    np.testing.assert_allclose(warm.theta_1, cold.theta_1, rtol=1e-9)


@pytest.mark.parametrize("factor", [1.0, 1.0 + 1e-6, 1.001, 1.05, 1.5])
def test_a_solution_near_by_costs_no_digits(factor: float) -> None:
    """The forces are those that the stresses at θ₁ have, and carry the load."""
    slip, load = np.linspace(-0.1, 0.8, 40), np.linspace(20.0, 100.0, 40)
    contact = Contact(SOIL, ContactLaw(0.5), slip, load)
    stiffer = contact._replace(soil=replace(SOIL, modulus=factor * SOIL.modulus))

    found = balance.solve(WHEEL, stiffer, balance.solve(WHEEL, contact))
    there = balance.rim_forces(WHEEL, stiffer, found.theta_1)
    np.testing.assert_allclose(found.forces.load, load, rtol=2e-10)
    np.testing.assert_allclose(np.array(found.forces), np.array(there), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "effect", ["rear_contact", "slip_sinkage", "shear_peak", "sidewall_friction", "grousers"]
)
def test_at_the_balances_entry_angle_any_modulus_gives_its_forces(effect: str) -> None:
    motion, effects = steady(), [typical(EFFECTS[effect])]
    solved = forward.carried(WHEEL, SOIL, motion, effects)
    stiffer = replace(SOIL, modulus=1.3 * SOIL.modulus)
    at = forward.carried_at(WHEEL, stiffer, motion, effects, solved.balance.theta_1)

    for here, there in zip(at.balance.forces, solved.balance.forces, strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-6)
    _, reaction = forward.felt(at, effects)
    response = forward.responded(solved, effects)
    np.testing.assert_allclose(reaction.torque, response.torque, rtol=1e-6)
    np.testing.assert_allclose(reaction.drawbar_pull, response.drawbar_pull, rtol=1e-6, atol=1e-6)


@pytest.mark.skipif(not balancing.BUILT, reason="gritd was installed without a compiler")
@pytest.mark.parametrize("order", [5, balance.ORDER])
@pytest.mark.parametrize("begun", [True, False])
def test_compiled_balances_are_those_of_numpy(
    monkeypatch: pytest.MonkeyPatch, begun: bool, order: int
) -> None:
    """In the air, braking, bogged, behind the axle, and with the peak at either end."""
    rng = np.random.default_rng(8)
    spread = np.exp(0.5 * rng.standard_normal((6, 300)))
    soil = Soil(1000.0 * spread[0], 0.6, 0.02 * spread[1], 1.0 * spread[2] ** 0.3, 1e6 * spread[3])
    law = ContactLaw(rng.uniform(-0.1, 1.1, 300), rng.uniform(-0.1, 0.2, 300), 1.1, 0.9, spread[4])
    load = np.where(rng.random(300) < 0.1, 0.0, 100.0 * spread[5] ** 3)
    contact = Contact(soil, law, rng.uniform(-0.3, 0.9, 300), load)
    near = balance.solve(WHEEL, contact._replace(load=1.1 * load)) if begun else None

    compiled = balance.solve(WHEEL, contact, near, order)
    monkeypatch.setattr(balancing, "BUILT", False)
    by_numpy = balance.solve(WHEEL, contact, near, order)

    assert by_numpy.overloaded.any() and not by_numpy.overloaded.all()
    np.testing.assert_array_equal(compiled.overloaded, by_numpy.overloaded)
    np.testing.assert_allclose(compiled.theta_1, by_numpy.theta_1, rtol=1e-10)
    np.testing.assert_allclose(np.array(compiled.forces), np.array(by_numpy.forces), atol=1e-8)


@pytest.mark.parametrize("built", [False, True])
def test_what_is_no_number_gives_no_number(monkeypatch: pytest.MonkeyPatch, built: bool) -> None:
    """An effect may run away: its neighbours are not touched, and nothing is made up for it."""
    monkeypatch.setattr(balancing, "BUILT", built and balancing.BUILT)
    slip, load = np.full(3, 0.2), np.full(3, 60.0)
    slip[1] = np.nan
    found = balance.solve(WHEEL, Contact(SOIL, ContactLaw(0.5), slip, load))
    np.testing.assert_allclose(found.forces.load[[0, 2]], 60.0, rtol=1e-8)
    assert np.isnan(found.forces.drawbar_pull[1])


def test_samples_do_not_depend_on_their_neighbours() -> None:
    slip, load = (
        np.linspace(0.0, 0.8, 3 * balance.CHUNK),
        np.linspace(20.0, 100.0, 3 * balance.CHUNK),
    )
    whole = balance.solve(WHEEL, Contact(SOIL, ContactLaw(0.5), slip, load)).theta_1
    part = balance.solve(
        WHEEL, Contact(SOIL, ContactLaw(0.5), slip[1000:1100], load[1000:1100])
    ).theta_1
    np.testing.assert_allclose(part, whole[1000:1100], rtol=1e-12)


def test_wheel_too_heavy_is_bogged_and_finite() -> None:
    response = forward.simulate_arrays(WHEEL, SOIL, steady(load=5e3))
    assert response.overloaded.all()
    assert np.isfinite(response.torque).all()
    assert response.sinkage[0] == pytest.approx(WHEEL.radius * (1.0 - np.cos(balance.DEEPEST)))


@pytest.mark.parametrize("load", [0.0, -5.0])
def test_lifted_wheel_feels_no_soil(load: float) -> None:
    response = forward.simulate_arrays(WHEEL, SOIL, steady(load=load))
    for value in (
        response.theta_1,
        response.sinkage,
        response.torque,
        response.drawbar_pull,
        response.load,
    ):
        assert np.all(value == 0.0)


def test_reverse_mirrors_forward() -> None:
    ahead = forward.simulate_arrays(WHEEL, SOIL, steady())
    motion = steady()
    back = forward.simulate_arrays(
        WHEEL,
        SOIL,
        Motion(
            motion.time,
            -motion.wheel_angle,
            -motion.wheel_speed,
            motion.carriage_position,
            -motion.carriage_speed,
            65.0,
        ),
    )
    np.testing.assert_allclose(back.torque, -ahead.torque)
    np.testing.assert_allclose(back.drawbar_pull, -ahead.drawbar_pull)
    np.testing.assert_allclose(back.sinkage, ahead.sinkage)


@given(rim=st.floats(-0.1, 0.1), travel=st.floats(-0.1, 0.1))
@settings(max_examples=200)
def test_slip_is_bounded_continuous_and_odd(rim: float, travel: float) -> None:
    slip, direction = signed_slip(rim, travel)
    assert -1.0 <= slip <= 1.0 and -1.0 <= direction <= 1.0
    mirrored, reverse = signed_slip(-rim, -travel)
    assert mirrored == slip and reverse == -direction
    assert abs(signed_slip(rim + 1e-9, travel)[0] - slip) < 1e-4


def test_slip_is_the_papers_where_the_wheel_moves() -> None:
    assert signed_slip(0.02, 0.015)[0] == pytest.approx(0.25)
    assert signed_slip(0.015, 0.02)[0] == pytest.approx(-0.25)
    assert signed_slip(0.02, 0.0)[0] == 1.0


DRIVETRAIN = (
    "asymmetric_friction",
    "coulomb_friction",
    "gear_ripple",
    "motor_heating",
    "stribeck_friction",
)


def test_axle_torque_is_the_exact_inverse_of_drive() -> None:
    effects = tuple(
        typical(EFFECTS[name])
        for name in (*DRIVETRAIN, "viscous_friction", "torque_constant_error")
    )
    moving = situation_of(campaign(1)[0], WHEEL)
    balanced = advanced(Balanced, moving, **{**BALANCED, "torque": 2.0 + moving.slip})
    situation, _ = forward.drive(balanced, effects, 2.0)
    np.testing.assert_allclose(
        forward.axle_torque(situation, effects, 2.0), 2.0 + situation.slip, atol=1e-6
    )


def test_a_float_instant_gives_what_the_array_gives() -> None:
    effects = tuple(
        typical(EFFECTS[name]) for name in ("coulomb_friction", "viscous_friction", "gear_ripple")
    )
    motion = steady()
    whole = situation_of(motion, WHEEL)
    one = situation_of(
        Motion(
            0.4,
            motion.wheel_angle[10],
            0.3,
            0.0,
            motion.carriage_speed[10],
            65.0,
            wheel_acceleration=0.0,
        ),
        WHEEL,
    )
    alone, among = (advanced(Complete, each, **BALANCED, current=1.5) for each in (one, whole))
    torque = forward.axle_torque(among, effects, 2.0)
    assert forward.axle_torque(alone, effects, 2.0) == pytest.approx(torque[10])


def test_heating_on_line_follows_the_batch() -> None:
    heat = {"fall": 0.5, "duration": 5.0, "winding_fall": 0.2, "winding": 3.0}
    effect = make("motor_heating", heat)
    current = 1.0 + np.sin(np.arange(300) / 20.0)
    situation = advanced(Complete, situation_of(steady(n=300), WHEEL), **BALANCED, current=current)
    batch = effect.torque_factor(situation)
    memory, live = effect.at_start, []
    for now in current:
        at = replace(situation, current=now, memory={effect.name: memory})
        memory = effect.remember(memory, 0.04, at)
        live.append(effect.torque_factor(replace(at, memory={effect.name: memory})))
    np.testing.assert_allclose(live[1:], batch[1:], rtol=0.01)


def test_a_measured_sinkage_is_used_where_an_effect_asks_for_its_direction() -> None:
    """The axis sticks against its motion: a wheel that rises carries more than one that sinks."""
    effect, motion = typical(EFFECTS["load_axis_friction"]), campaign(1)[0]
    sinking = 0.01 + 1e-4 * (np.asarray(motion.time) - motion.time[0])

    def load(sinkage: np.ndarray) -> np.ndarray:
        measured = replace(motion, sinkage=sinkage)
        return np.asarray(forward.simulate_arrays(WHEEL, SOIL, measured, (effect,)).load)

    apart = load(sinking[::-1]) - load(sinking)
    assert apart[len(apart) // 2 :] == pytest.approx(2.0 * effect.friction, rel=0.01)
