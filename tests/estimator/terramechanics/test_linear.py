"""The closed forms against quadrature of (15)-(17), in every limit, and their gradients against
differences.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gritd.estimator.terramechanics import linear
from gritd.estimator.terramechanics.integrals import Integrals, integrals
from gritd.estimator.terramechanics.linear import ARRAYS, GRADIENT, predict, predict_batch
from gritd.estimator.terramechanics.soil import Wheel
from tests.jacobian import assert_jacobian

WHEEL = Wheel(radius=0.072, width=0.071)
SHIFTING = Wheel(radius=0.12, width=0.1, c1=0.43, c2=0.32)  # θₘ moves with slip


def by_quadrature(theta_1: float, ratio: float, f: float, order: int = 60) -> np.ndarray:
    """A₁ … C₃ over θ₁ by Gauss-Legendre on each side of θₘ."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    s = 0.5 * (nodes + 1)
    front = (1 - ratio, (1 - ratio) * s, (1 - s) + ratio * s, s)
    rear = (ratio, (1 - ratio) + ratio * s, ratio * (1 - s), 1 - s)
    total = np.zeros(8)
    for share, behind, ahead, hat in (front, rear):  # behind = (θ₁ − θ)/θ₁, ahead = θ/θ₁
        g = np.copysign(-np.expm1(-abs(f) * theta_1 * behind), f)
        sine, cosine, w = np.sin(theta_1 * ahead), np.cos(theta_1 * ahead), 0.5 * weights * share
        rows = (
            g,
            hat * g,
            hat * cosine,
            g * sine,
            hat * g * sine,
            g * cosine,
            hat * g * cosine,
            hat * sine,
        )
        total += [w @ row for row in rows]
    return total


@pytest.mark.long
def test_closed_forms_agree_with_quadrature_on_2000_random_draws() -> None:
    rng = np.random.default_rng(7)
    worst = 0.0
    for _ in range(2000):
        theta_1, ratio, f = rng.uniform(0.1, 1.3), rng.uniform(0, 1), rng.uniform(-3, 12)
        worst = max(
            worst,
            np.max(
                np.abs(
                    np.array(integrals(theta_1, ratio, f)) / by_quadrature(theta_1, ratio, f) - 1
                )
            ),
        )
    print(f"closed forms against quadrature, 2000 draws, largest relative difference: {worst:.1e}")
    assert worst < 1e-12


@pytest.mark.long
def test_forces_agree_with_quadrature_on_2000_random_draws() -> None:
    rng = np.random.default_rng(8)
    n = 2000
    c, tan_phi, k = rng.uniform(0, 5000, n), rng.uniform(0.2, 0.9, n), rng.uniform(0.005, 0.05, n)
    theta_1, slip, sigma_m = (
        rng.uniform(0.1, 1.2, n),
        rng.uniform(-0.3, 0.9, n),
        rng.uniform(1e3, 1e5, n),
    )
    ours = linear.forces(SHIFTING, c, tan_phi, k, theta_1, slip, sigma_m, ARRAYS)
    ratio = np.clip(SHIFTING.c1 + SHIFTING.c2 * slip, 0, 1)
    f = linear.shear_exponent(SHIFTING, k, theta_1, slip, ARRAYS).f
    x = Integrals(
        *np.transpose([by_quadrature(*row) for row in zip(theta_1, ratio, f, strict=True)])
    )
    r, b, s = SHIFTING.radius, SHIFTING.width, sigma_m * theta_1
    load = r * b * (s * (x.b1 + tan_phi * x.b3) + c * theta_1 * x.b2)
    torque = r * r * b * (c * theta_1 * x.a1 + s * tan_phi * x.a2)
    pull = r * b * (c * theta_1 * x.c1 + s * (tan_phi * x.c2 - x.c3))
    error = np.abs(
        [
            (ours.load - load) / load,
            (ours.torque - torque) / (r * load),
            (ours.drawbar_pull - pull) / load,
        ]
    )
    print(f"T, W, DP against quadrature, 2000 draws, largest difference: {error.max():.1e}")
    assert error.max() < 2e-13


@given(
    theta_1=st.one_of(st.floats(1e-8, 1.55), st.floats(-8, 0).map(lambda e: 10.0**e)),
    ratio=st.one_of(
        st.sampled_from([0.0, 0.5, 1.0]), st.floats(0, 1), st.floats(-14, 0).map(lambda e: 10.0**e)
    ),
    sign=st.sampled_from([-1.0, 1.0]),
    f=st.one_of(st.floats(0.01, 60.0), st.floats(-12, 1.7).map(lambda e: 10.0**e)),
)
@settings(max_examples=500)
def test_closed_forms_keep_their_digits_in_every_limit(
    theta_1: float, ratio: float, sign: float, f: float
) -> None:
    """θ₁ → 0, θₘ → 0, θₘ → θ₁, f → 0, f < 0, large f: each of the eight integrals to 1e-12 of
    itself.
    """
    np.testing.assert_allclose(
        integrals(theta_1, ratio, sign * f), by_quadrature(theta_1, ratio, sign * f), rtol=1e-12
    )


@pytest.mark.parametrize("theta_1", [0.0, 1e-300, 1e-100, 1e-12, 1e-3, 0.1])
@pytest.mark.parametrize("slip", [-1.0, -0.3, -1e-300, 0.0, 1e-300, 0.3, 1.0])
def test_finite_and_continuous_down_to_no_contact(theta_1: float, slip: float) -> None:
    prediction = predict(WHEEL, 1000.0, 0.577, 0.025, theta_1, slip, 70.0)
    near = predict(WHEEL, 1000.0, 0.577, 0.025, theta_1 * (1 + 1e-9) + 1e-12, slip, 70.0)
    for value, neighbour in zip(prediction[:3], near[:3], strict=True):
        assert math.isfinite(value)
        # a locked wheel shears the soil fully however short the contact, so there the step is
        # real
        assert slip == -1.0 or value == pytest.approx(neighbour, rel=1e-6, abs=1e-6)
    assert all(math.isfinite(entry) for gradient in prediction[4:] for entry in gradient)
    assert prediction.sigma_m > 0


def test_zero_slip_is_reached_smoothly_from_both_sides() -> None:
    slips = np.array([-1e-6, -1e-9, -1e-300, 0.0, 1e-300, 1e-9, 1e-6])
    result = predict_batch(WHEEL, 1000.0, 0.577, 0.025, 0.5, slips, 70.0)
    for values in (
        result.torque,
        result.drawbar_pull,
        result.torque_gradient[4],
        result.drawbar_pull_gradient[4],
    ):
        np.testing.assert_allclose(values, values[3], rtol=1e-4)
    assert np.all(np.diff(result.torque) >= 0)


def test_a_locked_wheel_is_held_by_the_full_strength() -> None:
    locked, sliding = (integrals(0.5, 0.5, f) for f in (-1e9, 1e9))
    assert locked.a1 == pytest.approx(-1.0) and sliding.a1 == pytest.approx(1.0)
    assert locked.a2 == pytest.approx(-0.5) and sliding.a2 == pytest.approx(0.5)


def test_exponent_is_equation_19() -> None:
    for slip in (0.0, 0.05, 0.6, 1.0):
        expected = 0.072 / (2 * 0.025) * ((1 + slip) - (1 - slip) * math.cos(0.7))
        assert linear.shear_exponent(WHEEL, 0.025, 0.7, slip).f == pytest.approx(
            expected, rel=1e-13
        )


def test_misprints_of_equation_22_are_corrected() -> None:
    """(22) for c = 0 and θₘ = θ₁/2, typed from the corrected table of docs/physics.md."""
    theta_1, f, r, b, sigma_m, tan_phi = 0.6, 0.9, 0.072, 0.071, 4e4, 0.577
    m = theta_1 / 2
    hat = theta_1 / 2 - (1 - 2 * math.exp(-f * m) + math.exp(-f * theta_1)) / (f**2 * m)
    x = integrals(theta_1, 0.5, f)
    assert theta_1 * x.a2 == pytest.approx(hat, rel=1e-12)
    assert theta_1 * x.a1 == pytest.approx(theta_1 - (1 - math.exp(-f * theta_1)) / f, rel=1e-12)
    k = r * ((1 + 0.2) - 0.8 * math.cos(theta_1)) / (2 * f)
    torque = linear.forces(Wheel(r, b), 0.0, tan_phi, k, theta_1, 0.2, sigma_m).torque
    assert torque == pytest.approx(r * r * b * sigma_m * tan_phi * hat, rel=1e-12)


soil_and_state = st.tuples(
    st.floats(0, 8e3), st.floats(0.1, 1.2), st.floats(0.004, 0.1), st.floats(0.05, 1.1),
    st.one_of(st.floats(0.01, 0.98), st.floats(-0.6, -0.01)), st.floats(5, 300),
)  # fmt: skip


@given(x=soil_and_state, wheel=st.sampled_from([WHEEL, SHIFTING]))
@settings(max_examples=200)
def test_gradients_agree_with_differences(x: tuple[float, ...], wheel: Wheel) -> None:
    c, tan_phi, k, theta_1, slip, load = x
    # where f changes sign the second derivative jumps and differences lose their order
    assume(abs(linear.shear_exponent(wheel, k, theta_1, slip).f) > 0.02 * wheel.radius / k)
    # the closed forms under a load do not know the exponent; the peak's place moves with c₁
    state = np.array([c, tan_phi, math.log(k), theta_1, slip, load, 1.1, wheel.c1])

    def outputs(y: np.ndarray) -> list[float]:
        moved = replace(wheel, c1=y[7])
        return list(predict(moved, y[0], y[1], math.exp(y[2]), *y[3:6])[:3])

    prediction = predict(wheel, *x)
    gradients = [
        prediction.torque_gradient,
        prediction.drawbar_pull_gradient,
        prediction.resistance_gradient,
    ]
    assert len(gradients[0]) == len(GRADIENT)
    assert_jacobian(
        outputs,
        gradients,
        state,
        step=[100, 0.002, 0.002, 0.002, 0.002, 1.0, 0.1, 0.002],
        rtol=1e-5,
    )


def test_gradients_are_continuous_where_the_exponent_changes_sign() -> None:
    half = math.sin(0.35) ** 2
    root = -half  # lag + (1 − lag) sin²(θ₁/2) = 0 with lag = i/(1 + i)
    below, above = (
        predict(WHEEL, 1000.0, 0.577, 0.025, 0.7, root + step, 70.0) for step in (-1e-9, 1e-9)
    )
    assert linear.shear_exponent(WHEEL, 0.025, 0.7, root).f == pytest.approx(0.0, abs=1e-12)
    for lower, upper in zip(below[4:], above[4:], strict=True):
        assert lower == pytest.approx(upper, rel=1e-6, abs=1e-6)


@given(x=soil_and_state)
@settings(max_examples=100)
def test_peak_stress_carries_the_load(x: tuple[float, ...]) -> None:
    """(21) backward and forward: σₘ from W gives W again, and the same T and DP."""
    prediction = predict(SHIFTING, *x)
    forces = linear.forces(SHIFTING, *x[:5], prediction.sigma_m)
    assert forces.load == pytest.approx(x[5], rel=1e-11)
    assert linear.forces_under_load(SHIFTING, *x) == pytest.approx(forces, rel=1e-9, abs=1e-9)
    expected = (forces.torque, forces.drawbar_pull, forces.resistance)
    assert prediction[:3] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_batch_equals_numbers() -> None:
    rng = np.random.default_rng(9)
    n = 500
    columns = [
        rng.uniform(0, 8e3, n), rng.uniform(0.1, 1.2, n), 10 ** rng.uniform(-2.5, -1, n),
        10 ** rng.uniform(-4, 0.1, n), rng.choice([0.0, 1e-9, 1.0, -0.4, 0.2, 0.7], n),
        rng.uniform(5, 300, n),
    ]  # fmt: skip
    batch = predict_batch(SHIFTING, *columns)
    for index in range(n):
        one = predict(SHIFTING, *(float(column[index]) for column in columns))
        for ours, theirs in zip(batch[:4], one[:4], strict=True):
            assert ours[index] == pytest.approx(theirs, rel=1e-10, abs=1e-12)
        for ours, theirs in zip(batch[4:], one[4:], strict=True):
            assert [entry[index] for entry in ours] == pytest.approx(
                list(theirs), rel=1e-9, abs=1e-9
            )


def test_batch_broadcasts_scalars() -> None:
    prediction = predict_batch(WHEEL, 1000.0, 0.577, 0.025, np.linspace(0.2, 0.8, 7), 0.2, 70.0)
    assert prediction.torque.shape == (7,)
    assert all(entry.shape == (7,) for entry in prediction.drawbar_pull_gradient)


def test_stress_triangles() -> None:
    theta = np.array([0.0, 0.1, 0.2, 0.4, 0.6, 0.7])
    np.testing.assert_allclose(
        linear.normal_stress(0.6, 0.2, 1e4, theta), [0, 5e3, 1e4, 5e3, 0, 0], atol=1e-9
    )
    tau_m = linear.tau_m(WHEEL, 1000.0, 0.577, 0.025, 0.6, 0.2, 1e4)
    f = linear.shear_exponent(WHEEL, 0.025, 0.6, 0.2).f
    assert tau_m == pytest.approx((1000 + 5770) * (1 - math.exp(-f * 0.3)), rel=1e-12)
