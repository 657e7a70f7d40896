"""The plant against independent quadrature, mechanics that must hold, and (for the bare equations)
the estimator.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.situation import Motion as EncoderMotion
from gritd.estimator.terramechanics.soil import Soil, Wheel
from gritd.tools.proof.blind.plant.concealed import LISTED, UNLISTED
from gritd.tools.proof.blind.plant.concealed.friction import lugre, maxwell
from gritd.tools.proof.blind.plant.contact import Rim, reaction
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import drive, respond, responses
from gritd.tools.proof.blind.plant.servo import Servo, follow
from tests.tools.proof.blind.scene import FACTS, GROUND, RIG, WORLD, run

pytestmark = pytest.mark.long

Friction = Callable[[Array, Array, float], Array]
EFFECTS = LISTED | UNLISTED
READ = ("sinkage", "current", "pull", "load", "torque", "carriage", "side")
FELT = {
    "sinkage": 2e-5,
    "current": 5e-3,
    "pull": 0.2,
    "load": 0.2,
    "torque": 0.01,
    "carriage": 1e-4,
    "side": 0.2,
}  # what a sensor would notice


@settings(max_examples=25)
@given(st.floats(0.1, 1.2), st.floats(0.0, 0.7), st.floats(0.4, 1.4), st.floats(0.0, 0.5))
def test_integrals_agree_with_adaptive_quadrature(
    theta_1: float, slip: float, n: float, rebound: float
) -> None:
    ground, r, b = replace(GROUND, exponent=n, modulus=2e5), 0.072, 0.071
    felt = reaction(ground, Rim(rebound=rebound), r, b, np.array([1.0 - slip]), np.array([theta_1]))
    theta_m, theta_2 = 0.5 * theta_1, -np.arccos(1.0 - rebound * (1.0 - np.cos(theta_1)))

    def sigma(theta: float) -> float:
        at = (
            theta
            if theta > theta_m
            else theta_1 - (theta - theta_2) / (theta_m - theta_2) * (theta_1 - theta_m)
        )
        return 2e5 * (r * max(np.cos(at) - np.cos(theta_1), 0.0)) ** n

    def tau(theta: float) -> float:
        j = r * (theta_1 - theta - (1.0 - slip) * (np.sin(theta_1) - np.sin(theta)))
        return float(np.sign(j) * (1000.0 + 0.577 * sigma(theta)) * (1.0 - np.exp(-abs(j) / 0.025)))

    def whole(f) -> float:  # type: ignore[no-untyped-def]
        return sum(
            quad(f, *zone, epsabs=1e-9, limit=200)[0]
            for zone in ((theta_2, theta_m), (theta_m, theta_1))
        )

    load = r * b * whole(lambda t: sigma(t) * np.cos(t) + tau(t) * np.sin(t))
    torque = r * r * b * whole(tau)
    pull = r * b * whole(lambda t: tau(t) * np.cos(t) - sigma(t) * np.sin(t))
    # behind the wheel shear changes sign where the rim rolls faster than it slips: a kink costs
    # digits
    close = 1e-6 if rebound == 0.0 else 2e-3
    assert felt.load[0] == pytest.approx(load, rel=close)
    assert felt.torque[0] == pytest.approx(torque, rel=close, abs=close * load * r)
    assert felt.pull[0] == pytest.approx(pull, rel=close, abs=close * load)


def test_without_effects_it_is_the_papers_wheel() -> None:
    """Same equations, other code: where nothing is concealed the estimator's forward model must
    agree when steady.
    """
    felt = drive(WORLD, run(passes=1))
    m = felt.scene.motion
    reported = EncoderMotion(m.time, m.turn, m.omega, m.travel, m.speed, felt.load)
    soil = Soil(
        GROUND.cohesion, GROUND.tan_phi, GROUND.shear_modulus, GROUND.exponent, GROUND.modulus
    )
    known = simulate_arrays(
        Wheel(RIG.radius, RIG.width), soil, reported, (), torque_constant=2.0
    ).sensed
    steady = (np.abs(np.gradient(m.omega, m.step)) < 1e-4) & (np.abs(m.omega) > 0.1)

    assert steady.sum() > 200

    for name, scale in (("sinkage", 0.01), ("torque", 2.0), ("drawbar_pull", 30.0)):
        mine = {"drawbar_pull": "pull"}.get(name, name)
        difference = np.abs(getattr(felt, mine) - getattr(known, name))[steady]
        assert np.median(difference) < 1e-4 * scale, name


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_off_at_zero_and_felt_at_its_largest(name: str) -> None:
    plain = drive(WORLD, run())
    for form in EFFECTS[name]:
        effect = form.drawn(np.random.default_rng(5), FACTS)
        off = respond(WORLD.with_effects(replace(effect, strength=0.0)), plain.scene.motion)
        for channel in READ:
            np.testing.assert_allclose(
                getattr(off, channel),
                getattr(plain, channel),
                rtol=2e-6,
                atol=1e-6,
                err_msg=f"{form.__name__}: {channel}",
            )
        on = drive(WORLD.with_effects(effect), run())
        changes = {ch: np.abs(getattr(on, ch) - getattr(plain, ch)) for ch in READ}
        assert all(np.isfinite(change).all() for change in changes.values()), form.__name__
        assert any(changes[ch].max() > FELT[ch] for ch in READ), form.__name__


@pytest.mark.parametrize("name", sorted(LISTED))
def test_an_effect_has_forms_that_differ(name: str) -> None:
    """Neither can be the other one at another strength."""
    orders = run()
    heavier = orders.weight * (1.0 + 0.4 * np.sin(0.8 * orders.time))
    orders = replace(orders, weight=heavier, time=6.0 * orders.time)
    plain, found = drive(WORLD, orders), []

    for form in LISTED[name]:
        felt = respond(
            WORLD.with_effects(form.drawn(np.random.default_rng(5), FACTS)), plain.scene.motion
        )
        parts = [(getattr(felt, ch) - getattr(plain, ch)) / FELT[ch] for ch in READ]
        found.append(np.concatenate(parts))

    assert len(found) >= 2

    for one, other in combinations(found, 2):
        left = one - other * (one @ other) / (other @ other)
        assert np.linalg.norm(left) > 0.005 * np.linalg.norm(one)


def test_known_scenes_stand_where_an_effect_does_not_meet_the_soil() -> None:
    """Taken from the scene without it, an effect of drive or sensor is what it is in full."""
    plain = respond(WORLD, drive(WORLD, run()).scene.motion, damped=False)
    motion = plain.scene.motion
    for name in ("coulomb_friction", "force_crosstalk", "contact_relaxation", "slip_sinkage"):
        for form in LISTED[name]:
            world = WORLD.with_effects(form.drawn(np.random.default_rng(5), FACTS))
            (quick,) = responses([(world, motion)], False, [plain.scene])
            slow = respond(world, motion, damped=False)
            for channel in READ:
                np.testing.assert_allclose(
                    getattr(quick, channel), getattr(slow, channel), rtol=1e-5, atol=1e-6
                )


@pytest.mark.parametrize("friction", [lugre, maxwell])
def test_friction_holds_against_motion_and_nothing_at_rest(friction: Friction) -> None:
    omega = np.concatenate((np.zeros(50), np.full(100, 0.3), np.full(100, -0.3)))
    torque = friction(omega, np.full(omega.size, 0.8), 0.02)
    assert np.all(torque[:50] == 0.0)
    np.testing.assert_allclose(torque[140:150], 0.8, rtol=1e-6)
    np.testing.assert_allclose(torque[-10:], -0.8, rtol=1e-6)


def test_a_controller_gives_way_to_a_load_and_recovers() -> None:
    wanted, against = np.full(500, 0.3), np.concatenate((np.zeros(250), np.full(250, 1.5)))
    speed = follow(Servo(8e-4, 100.0, 0.05), wanted, against, 0.004)
    assert 0.28 < speed[250:260].min() < 0.299
    np.testing.assert_allclose(speed[-20:], 0.3, rtol=1e-3)


def test_soil_does_not_lift_a_standing_wheel() -> None:
    orders = run()
    omega = np.where(orders.time > 9.0, 0.0, orders.omega)
    felt = drive(
        WORLD, replace(orders, omega=omega, speed=np.where(orders.time > 9.0, 0.0, orders.speed))
    )
    assert np.all(np.diff(felt.scene.sinkage[orders.time > 9.5]) > -1e-6)


def test_a_third_sweep_of_motion_against_soil_changes_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    two = drive(WORLD, run())
    monkeypatch.setattr("gritd.tools.proof.blind.plant.respond.SWEEPS", 4)
    four = drive(WORLD, run())
    for channel, small in (("sinkage", 2e-6), ("torque", 2e-3), ("pull", 0.02)):
        assert np.quantile(np.abs(getattr(two, channel) - getattr(four, channel)), 0.95) < small
