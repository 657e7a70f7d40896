"""What the formula of an effect says, against the equations written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, optimize

from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.filter.shift import IntegralShift
from gritd.estimator.model import balance
from gritd.estimator.model.forward import Response, simulate_arrays
from gritd.estimator.stages.situation import ContactLaw, Motion, situation_of
from gritd.estimator.terramechanics.original import forces
from gritd.tools.testbed.fingerprints import SOIL, WHEEL, campaign, typical


@pytest.fixture(scope="module")
def motion() -> Motion:
    return campaign(1)[0]


@pytest.fixture(scope="module")
def plain(motion: Motion) -> Response:
    return simulate_arrays(WHEEL, SOIL, motion)


def test_a_smooth_rim_is_a_rim_on_a_weaker_soil(motion: Motion) -> None:
    smooth = make("rim_friction", {"smoothness": 0.3, "adhesion_loss": 0.6})
    weaker = replace(SOIL, cohesion=0.4 * SOIL.cohesion, tan_phi=0.7 * SOIL.tan_phi)
    found = simulate_arrays(WHEEL, SOIL, motion, (smooth,))
    expected = simulate_arrays(WHEEL, weaker, motion)
    np.testing.assert_allclose(found.torque, expected.torque, rtol=1e-9)
    np.testing.assert_allclose(found.sinkage, expected.sinkage, rtol=1e-9)


@pytest.mark.parametrize("stiff", [30.0, 0.02])
def test_a_rim_slides_where_soil_would_carry_more(motion: Motion, stiff: float) -> None:
    """Soil that has hardly moved knows nothing of the rim; soil that yields at once is a weaker one
    to it. stiff: the shear modulus k over the usual one.
    """
    soil = replace(SOIL, shear_modulus=stiff * SOIL.shear_modulus)
    sliding = {"smoothness": 0.3, "adhesion_loss": 0.3, "sliding": 1.0}
    found = simulate_arrays(WHEEL, soil, motion, (make("rim_friction", sliding),))
    share = 1.0 if stiff > 1.0 else 0.7
    weaker = replace(soil, cohesion=share * soil.cohesion, tan_phi=share * soil.tan_phi)
    expected = simulate_arrays(WHEEL, weaker, motion)
    np.testing.assert_allclose(found.torque, expected.torque, rtol=0.02, atol=1e-3)


def test_a_wheel_that_slides_pushes_soil_before_its_side(motion: Motion) -> None:
    """By Hegedus's formula for a strip, over the side that is in the soil; the rest stays."""
    turned = {"angle": 0.4, "digging": 0.0}
    held, pushing = (
        simulate_arrays(WHEEL, SOIL, motion, (make("side_slip", {**turned, "pushing": share}),))
        for share in (0.0, 0.5)
    )
    np.testing.assert_allclose(pushing.drawbar_pull, held.drawbar_pull, rtol=1e-12)
    np.testing.assert_allclose(pushing.sinkage, held.sinkage, rtol=1e-12)

    phi = np.arctan(SOIL.tan_phi)
    x = 0.25 * np.pi - 0.5 * phi
    blade = 1.0 / np.tan(x) + np.tan(x + phi)
    weight = 15e3 * (1.0 / np.tan(x) + SOIL.tan_phi / np.tan(x) ** 2)

    def strip(theta: float, end: float) -> float:
        depth = WHEEL.radius * (np.cos(theta) - np.cos(end))
        wide = WHEEL.radius * np.cos(theta)
        return float(blade * (SOIL.cohesion * depth + 0.5 * weight * depth**2) * wide)

    more = np.subtract(pushing.sensed.side_force, held.sensed.side_force)
    for at in np.flatnonzero(situation_of(motion, WHEEL).direction > 0.0)[::200]:
        end = float(np.arccos(1.0 - held.sinkage[at] / WHEEL.radius))
        expected = 0.5 * np.sin(0.4) * integrate.quad(strip, 0.0, end, args=(end,))[0]
        assert more[at] == pytest.approx(expected, rel=1e-6)


def test_soil_springs_back_less_where_it_slips(motion: Motion, plain: Response) -> None:
    """A ratio that falls with slip is one ratio at one slip, and none beyond where it ends."""
    slip = np.asarray(situation_of(motion, WHEEL).slip)
    falling = make("rear_contact", {"ratio": 0.2, "slip_ratio": -0.5})
    found = simulate_arrays(WHEEL, SOIL, motion, (falling,)).sinkage
    for some in ((slip > 0.19) & (slip < 0.21), slip > 0.45):
        at = float(np.clip(0.2 - 0.5 * np.median(slip[some]), 0.0, 1.0))
        one = simulate_arrays(WHEEL, SOIL, motion, (make("rear_contact", {"ratio": at}),))
        assert some.sum() > 20
        np.testing.assert_allclose(found[some], one.sinkage[some], rtol=0.01)


def test_soil_is_sheared_as_fast_as_the_rim_slides(motion: Motion) -> None:
    """Where the rim slides as fast, strength is the same, whatever it is elsewhere."""
    rate = {"per_decade": 0.1, "sliding": 1.0}
    found = simulate_arrays(WHEEL, SOIL, motion, (make("rate_dependent_shear", rate),)).torque
    past = WHEEL.radius * np.asarray(motion.wheel_speed) - np.asarray(motion.carriage_speed)
    for quantile in (0.1, 0.9):
        speed = np.quantile(past, quantile)
        some = np.abs(past - speed) < 0.01 * speed
        strength = 1.0 + 0.1 * np.log10((speed + 1e-3) / (0.02 + 1e-3))
        other = replace(SOIL, cohesion=strength * SOIL.cohesion, tan_phi=strength * SOIL.tan_phi)
        expected = simulate_arrays(WHEEL, other, motion).torque
        np.testing.assert_allclose(found[some], expected[some], rtol=2e-3)


@pytest.mark.parametrize("slip", [0.05, 0.4])
def test_side_slip_turns_the_shear_stress(slip: float) -> None:
    """Ishigami et al. (2007), integrated by scipy."""
    theta_1, tangent, k = 0.8, 0.5, SOIL.shear_modulus
    theta_m = 0.5 * theta_1

    def stresses(theta: float) -> tuple[float, float]:
        """Shear stress along the wheel and across it."""
        front = theta if theta >= theta_m else theta_1 - theta
        depth = WHEEL.radius * max(np.cos(front) - np.cos(theta_1), 0.0)
        sigma = SOIL.modulus * depth**SOIL.exponent
        along = WHEEL.radius * (theta_1 - theta - (1.0 - slip) * (np.sin(theta_1) - np.sin(theta)))
        across = WHEEL.radius * (1.0 - slip) * (theta_1 - theta) * tangent
        total = np.hypot(along, across)
        strength = (SOIL.cohesion + sigma * SOIL.tan_phi) * (1.0 - np.exp(-total / k))
        return (strength * along / total, strength * across / total) if total else (0.0, 0.0)

    zones = ((0.0, theta_m), (theta_m, theta_1))
    along, across = (
        sum(integrate.quad(lambda theta, n=n: stresses(theta)[n], *zone)[0] for zone in zones)
        for n in (0, 1)
    )
    area = WHEEL.radius * WHEEL.width
    found = forces(WHEEL, SOIL, theta_1, slip, side_slip=tangent, order=40)
    assert float(found.torque) == pytest.approx(WHEEL.radius * area * along, rel=1e-6)
    assert float(found.side_force) == pytest.approx(area * across, rel=1e-6)
    assert found.torque < forces(WHEEL, SOIL, theta_1, slip, order=40).torque


def test_a_runout_of_the_hub_moves_the_potentiometer_alone(motion: Motion, plain: Response) -> None:
    lifted = simulate_arrays(WHEEL, SOIL, motion, (typical(EFFECTS["hub_runout"]),)).sensed
    assert np.ptp(lifted.sinkage - plain.sensed.sinkage) == pytest.approx(2e-3 * 2**0.5, rel=0.01)
    for channel in ("torque", "drawbar_pull", "load", "current"):
        np.testing.assert_array_equal(getattr(lifted, channel), getattr(plain.sensed, channel))


def test_an_inclined_bed_shows_in_the_potentiometer_and_in_the_pull(
    motion: Motion, plain: Response
) -> None:
    angle = 0.01
    found = simulate_arrays(WHEEL, SOIL, motion, (make("bed_inclination", {"angle": angle}),))
    climbed = (plain.sensed.sinkage - found.sensed.sinkage) / np.asarray(motion.carriage_position)
    np.testing.assert_allclose(climbed[100:], np.tan(angle), rtol=0.02)
    lost = (plain.drawbar_pull - found.drawbar_pull) / np.asarray(motion.load)
    np.testing.assert_allclose(lost, np.sin(angle), rtol=0.02)


def test_a_loaded_bearing_consumes_nothing_in_the_air(motion: Motion, plain: Response) -> None:
    bearing = make("load_dependent_friction", {"arm": 2e-3})
    lost = simulate_arrays(WHEEL, SOIL, motion, (bearing,)).motor_torque - plain.motor_torque
    np.testing.assert_allclose(lost, 2e-3 * np.asarray(motion.load), rtol=1e-6)
    lifted = replace(motion, load=0.0)
    np.testing.assert_array_equal(simulate_arrays(WHEEL, SOIL, lifted, (bearing,)).motor_torque, 0)


@pytest.mark.parametrize("ratio", [0.0, 0.9])
def test_the_stress_may_peak_anywhere_on_the_rim(ratio: float) -> None:
    shifted = make("stress_peak_shift", {"share": ratio - 0.5})
    slip, load = np.linspace(0.0, 0.8, 9), np.full(9, 20.0)
    found = balance.solve(WHEEL, balance.Contact(SOIL, ContactLaw(ratio), slip, load))
    np.testing.assert_allclose(found.forces.load, load, rtol=1e-8)
    shift = IntegralShift(WHEEL, SOIL, (shifted,)).at(0.025, 0.7, 0.3)
    assert all(np.isfinite(entry) for integrals in shift for entry in integrals)


def test_a_towed_wheel_is_a_wheel_whose_torque_vanishes() -> None:
    """Without a drive the wheel skids so far that the soil turns it against its bearing's loss."""

    def found(slip: float, loss: float) -> tuple[float, float]:
        speed, n = 0.3, 10
        travel, time = WHEEL.radius * speed / (1.0 + slip), np.arange(n) / 25.0
        motion = Motion(
            time, speed * time, np.full(n, speed), travel * time, np.full(n, travel), 60.0
        )
        friction = make("coulomb_friction", {"loss": loss})
        response = simulate_arrays(WHEEL, SOIL, motion, (friction,))
        return float(response.motor_torque[-1]), float(response.drawbar_pull[-1])

    free, braked = (
        optimize.brentq(lambda slip, loss=loss: found(slip, loss)[0], -0.9, 0.2)
        for loss in (0.0, 0.1)
    )
    assert braked < free < 0.0
    assert found(braked, 0.1)[1] < found(free, 0.0)[1] < 0.0  # it has to be pulled
