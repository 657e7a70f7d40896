"""The original model against scipy's adaptive quadrature of Eqs. (8)-(10), written out a second
time here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gritd.estimator.terramechanics.original import (
    arc,
    contact,
    forces,
    integrate,
    janosi,
    shear_displacement,
    theta_m,
    velocity_ratio,
)
from gritd.estimator.terramechanics.soil import Soil, Wheel
from gritd.estimator.terramechanics.soils import DRY_SAND, TABLE_1

WHEEL = Wheel(radius=0.072, width=0.071)
SAND = DRY_SAND.under(WHEEL.width)


def by_adaptive_quadrature(
    wheel: Wheel, soil: Soil, theta_1: float, slip: float, theta_2: float
) -> list[float]:
    """DP, W, T and resistance from the printed integrals; (6) without its misprint."""
    r, peak = wheel.radius, (wheel.c1 + wheel.c2 * slip) * theta_1
    ratio = 1 - slip if slip >= 0 else 1 / (1 + slip)

    def sigma(theta: float) -> float:
        if theta < peak:
            theta = theta_1 - (theta - theta_2) * (theta_1 - peak) / (peak - theta_2)
        return (
            soil.modulus
            * r**soil.exponent
            * max(np.cos(theta) - np.cos(theta_1), 0.0) ** soil.exponent
        )

    def tau(theta: float) -> float:
        j = r * (theta_1 - theta - ratio * (np.sin(theta_1) - np.sin(theta)))
        strength = soil.cohesion + sigma(theta) * soil.tan_phi
        return strength * np.sign(j) * (1 - np.exp(-abs(j) / soil.shear_modulus))

    def over_contact(integrand) -> float:
        zones = ((theta_2, peak), (peak, theta_1))
        return sum(quad(integrand, *zone, epsabs=0, epsrel=1e-11, limit=400)[0] for zone in zones)

    area = r * wheel.width
    resistance = area * over_contact(lambda t: sigma(t) * np.sin(t))
    return [
        area * over_contact(lambda t: tau(t) * np.cos(t)) - resistance,
        area * over_contact(lambda t: tau(t) * np.sin(t) + sigma(t) * np.cos(t)),
        r * area * over_contact(tau),
        resistance,
        0.0,
    ]


@pytest.mark.parametrize("named", TABLE_1, ids=lambda soil: soil.name)
@pytest.mark.parametrize("slip", [0.0, 0.2, 0.9, -0.2])
def test_forces_agree_with_adaptive_quadrature(named, slip: float) -> None:
    wheel = Wheel(0.072, 0.071, c1=0.43, c2=0.32)
    soil = named.under(wheel.width)
    for theta_1, theta_2 in ((0.1, 0.0), (0.5, -0.08), (1.0, 0.0)):
        ours = forces(wheel, soil, theta_1, slip, theta_2=theta_2)
        theirs = by_adaptive_quadrature(wheel, soil, theta_1, slip, theta_2)
        scale = [theirs[1], theirs[1], wheel.radius * theirs[1], theirs[1], theirs[1]]
        # braking has a kink where j changes sign inside the contact
        limit = 1e-9 if slip >= 0 else 1e-4
        assert np.max(np.abs(np.subtract(ours, theirs)) / scale) < limit


def test_quadrature_error_over_the_documented_range() -> None:
    """The figures of docs/physics.md: error relative to W (rW for T), 16 nodes a zone, not 200."""
    rng = np.random.default_rng(5)
    n = 4000
    wheel = Wheel(0.15, 0.15)
    soil = Soil(
        rng.uniform(200, 5000, n), rng.uniform(0.2, 0.8, n), rng.uniform(0.01, 0.05, n),
        rng.uniform(0.5, 1.6, n), rng.uniform(2e5, 3e6, n),
    )  # fmt: skip
    theta_1, slip = rng.uniform(0.05, 1.2, n), rng.uniform(0, 0.9, n)
    ours, fine = forces(wheel, soil, theta_1, slip), forces(wheel, soil, theta_1, slip, order=200)
    scale = np.stack([fine.load, fine.load, wheel.radius * fine.load, fine.load, fine.load])
    error = np.abs(np.subtract(ours, fine)) / scale
    print(f"quadrature error: median {np.median(error):.1e}, largest {np.max(error):.1e}")
    assert np.max(error) < 1e-7


def test_samples_do_not_influence_each_other_and_soil_may_vary() -> None:
    theta_1, slip = np.array([0.3, 0.5, 0.7]), np.array([0.1, -0.1, 0.5])
    cohesion = np.array([200.0, 1000.0, 5000.0])
    together = forces(WHEEL, Soil(cohesion, 0.6, 0.02, 1.1, 1.5e6), theta_1, slip)
    for index in range(3):
        alone = forces(
            WHEEL, Soil(cohesion[index], 0.6, 0.02, 1.1, 1.5e6), theta_1[index], slip[index]
        )
        assert [field[index] for field in together] == pytest.approx(
            [float(x) for x in alone], rel=1e-13
        )
    assert together.torque.shape == (3,) and np.shape(alone.torque) == ()


@pytest.mark.parametrize("slip", [-0.5, -1e-6, 0.0, 1e-6, 0.4, 1.0])
def test_shear_displacement_is_the_path_integral_of_slip_velocity(slip: float) -> None:
    theta_1, theta = 0.6, 0.15
    ratio = float(velocity_ratio(slip))
    path, _ = quad(lambda t: WHEEL.radius * (1 - ratio * np.cos(t)), theta, theta_1)
    assert shear_displacement(WHEEL, slip, arc(theta_1, theta)) == pytest.approx(path, rel=1e-12)


def test_driving_equation_6_is_the_corrected_one() -> None:
    theta_1, theta, slip = 0.6, 0.15, 0.3
    corrected = WHEEL.radius * (theta_1 - theta - (1 - slip) * (np.sin(theta_1) - np.sin(theta)))
    assert shear_displacement(WHEEL, slip, arc(theta_1, theta)) == pytest.approx(
        corrected, rel=1e-13
    )


def test_braking_joins_driving_smoothly_and_drags() -> None:
    step = 1e-5
    slips = np.array([-2 * step, -step, 0.0, step, 2 * step])
    torque = forces(WHEEL, SAND, 0.5, slips).torque
    left, right = (torque[2] - torque[1]) / step, (torque[3] - torque[2]) / step
    assert left == pytest.approx(right, rel=1e-3)
    deep = forces(WHEEL, SAND, 0.5, np.array([-0.4, -0.9, -1.0]))
    assert np.all(deep.torque < 0) and np.all(deep.drawbar_pull < -deep.resistance)
    assert np.all(np.isfinite(np.stack(deep)))


def test_mobilisation_has_the_sign_of_displacement_and_saturates() -> None:
    x = np.array([-1e9, -1.0, -1e-12, 0.0, 1e-12, 1.0, 1e9])
    expected = [-1, -(1 - np.exp(-1)), -1e-12, 0, 1e-12, 1 - np.exp(-1), 1]
    np.testing.assert_allclose(janosi(x), expected, rtol=1e-11)


def test_another_mobilisation_replaces_janosi() -> None:
    rigid_plastic = forces(WHEEL, SAND, 0.5, 0.3, mobilisation=np.ones_like)
    assert rigid_plastic.torque > forces(WHEEL, SAND, 0.5, 0.3).torque
    assert rigid_plastic.resistance == forces(WHEEL, SAND, 0.5, 0.3).resistance


def test_stresses_can_be_changed_between_contact_and_integrate() -> None:
    stresses = contact(WHEEL, SAND, np.array([0.4, 0.6]), 0.2)
    without_shear = integrate(WHEEL, stresses._replace(tau=0.0 * stresses.tau))
    assert np.all(without_shear.torque == 0) and np.all(
        without_shear.drawbar_pull == -without_shear.resistance
    )


def test_angle_of_maximum_stress() -> None:
    wheel = Wheel(0.1, 0.1, c1=0.43, c2=0.32)
    assert theta_m(wheel, 0.5, 0.6) == pytest.approx((0.43 + 0.16) * 0.6)
    assert theta_m(Wheel(0.1, 0.1, c1=0.9, c2=1.0), 0.5, 0.6) == pytest.approx(
        0.6
    )  # never ahead of entry


@given(
    theta_1=st.floats(0.0, 1.5),
    slip=st.floats(-1.0, 1.0),
    share=st.sampled_from([0.0, 1e-12, 0.5, 1.0 - 1e-12, 1.0]),
    exponent=st.floats(0.3, 2.0),
)
@settings(max_examples=200)
def test_finite_over_the_whole_range(
    theta_1: float, slip: float, share: float, exponent: float
) -> None:
    soil = Soil(1000.0, 0.6, 0.01, exponent, 1e6)
    result = forces(Wheel(0.2, 0.1), soil, theta_1, slip, theta_m=share * theta_1)
    assert all(np.isfinite(value) for value in result)
    assert result.resistance >= 0.0


def test_forces_vanish_with_the_contact() -> None:
    result = np.stack(forces(WHEEL, SAND, np.array([1e-1, 1e-3, 1e-8, 1e-300, 0.0]), 0.2))
    assert (
        np.all(np.diff(np.abs(result[1])) <= 0)
        and np.all(np.isfinite(result))
        and np.all(result[:, -1] == 0)
    )
