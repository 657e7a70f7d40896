"""With the shift, the closed forms give the forces of the original equations, and c and tan φ come
out right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.estimator.filter.shift import SLIP, THETA_1, IntegralShift
from gritd.estimator.model import balance
from gritd.estimator.stages.situation import ContactLaw
from gritd.estimator.terramechanics import linear, original
from gritd.estimator.terramechanics.soil import Soil, Wheel
from gritd.estimator.terramechanics.soils import DRY_SAND, LOOSE_SAND, MARS_LIKE, SANDY_LOAM
from gritd.tools.paper.separability import fit

WHEEL = Wheel(radius=0.072, width=0.071)
SAND = DRY_SAND.under(WHEEL.width)


def draws(count, seed):
    rng = np.random.default_rng(seed)
    return zip(
        rng.uniform(0.1, 1.3, count).tolist(), rng.uniform(-0.05, 0.95, count).tolist(), strict=True
    )


def test_any_cohesion_friction_and_load_at_the_tabled_k():
    """Exact in c, tan φ and W: only the table's interpolation is left."""
    shift, rng = IntegralShift(WHEEL, SAND), np.random.default_rng(2)
    for theta_1, slip in draws(300, 1):
        c, tan_phi, modulus = (
            rng.uniform(50, 4000),
            rng.uniform(0.2, 0.9),
            SAND.modulus * rng.uniform(0.3, 3.0),
        )
        true = original.forces(
            WHEEL,
            Soil(c, tan_phi, SAND.shear_modulus, SAND.exponent, modulus),
            theta_1,
            slip,
            order=40,
        )
        found = linear.predict(
            WHEEL,
            c,
            tan_phi,
            0.025,
            theta_1,
            slip,
            float(true.load),
            shift=shift.at(0.025, theta_1, slip),
        )
        scale = WHEEL.radius * float(true.load)
        assert abs(found.torque - true.torque) < 2e-4 * scale
        assert abs(found.drawbar_pull - true.drawbar_pull) < 1e-4 * float(true.load)


def test_a_k_off_by_15_percent_is_followed():
    shift = IntegralShift(WHEEL, SAND)
    for factor in (0.85, 1.15):
        k = 0.025 * factor
        for theta_1, slip in draws(60, 3):
            true = original.forces(WHEEL, replace(SAND, shear_modulus=k), theta_1, slip)
            found = linear.predict(
                WHEEL,
                1000.0,
                SAND.tan_phi,
                k,
                theta_1,
                slip,
                float(true.load),
                shift=shift.at(k, theta_1, slip),
            )
            assert abs(found.torque - true.torque) < 1e-3 * WHEEL.radius * float(true.load)


def test_gradients():
    shift, x = IntegralShift(WHEEL, SAND), np.array([900.0, 0.6, np.log(0.027), 0.7, 0.3, 80.0])

    def torque_and_pull(x):
        c, tan_phi, ln_k, theta_1, slip, load = x.tolist()
        p = linear.predict(
            WHEEL,
            c,
            tan_phi,
            np.exp(ln_k),
            theta_1,
            slip,
            load,
            shift=shift.at(np.exp(ln_k), theta_1, slip),
        )
        return np.array((p.torque, p.drawbar_pull, p.resistance)), np.array(
            (p.torque_gradient, p.drawbar_pull_gradient, p.resistance_gradient)
        )

    _, gradient = torque_and_pull(x)
    for column, step in enumerate((1e-2, 1e-6, 1e-6, 1e-6, 1e-6, 1e-3)):
        up, down = x.copy(), x.copy()
        up[column] += step
        down[column] -= step
        slope = (torque_and_pull(up)[0] - torque_and_pull(down)[0]) / (2 * step)
        np.testing.assert_allclose(gradient[:, column], slope, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "named", [DRY_SAND, SANDY_LOAM, LOOSE_SAND, MARS_LIKE], ids=lambda n: n.name
)
@pytest.mark.parametrize(
    "prior", [{}, {"cohesion": 1.25, "tan_phi": 0.95}, {"shear_modulus": 1.15}], ids=str
)
def test_c_and_tan_phi_are_found(named, prior):
    """Issue: bias of c within 5 % or 40 Pa, of tan φ within 1.5 %, loads 30-105 N, slips 5-60 %, no
    noise.
    """
    soil = named.under(WHEEL.width)
    wrong = replace(soil, **{name: factor * getattr(soil, name) for name, factor in prior.items()})
    c, tan_phi = fit(soil, IntegralShift(WHEEL, wrong))
    assert abs(c - soil.cohesion) < max(0.01 * soil.cohesion, 10.0)
    assert tan_phi == pytest.approx(soil.tan_phi, rel=0.003)


def test_an_effect_of_the_contact_is_carried_along():
    """With a rear contact configured, the closed forms give the forces of a wheel with a rear
    contact.
    """
    rear = make("rear_contact", {"ratio": 0.25})
    shift = IntegralShift(WHEEL, SAND, (rear,))
    slip, load = np.linspace(0.1, 0.6, 6), np.full(6, 70.0)
    true = balance.solve(
        WHEEL, balance.Contact(SAND, ContactLaw(0.5, theta_2_ratio=0.25), slip, load)
    )
    for n, (theta_1, i) in enumerate(zip(true.theta_1.tolist(), slip.tolist(), strict=True)):
        found = linear.predict(
            WHEEL,
            SAND.cohesion,
            SAND.tan_phi,
            0.025,
            theta_1,
            i,
            70.0,
            shift=shift.at(0.025, theta_1, i),
        )
        assert found.torque == pytest.approx(true.forces.torque[n], rel=1e-3)
        assert found.drawbar_pull == pytest.approx(true.forces.drawbar_pull[n], abs=0.01)


def test_nothing_is_shifted_without_share_and_effects():
    shift = IntegralShift(WHEEL, SAND, share=0.0).at(0.025, 0.7, 0.3)
    assert all(entry == 0.0 for integrals in shift for entry in integrals)


@pytest.mark.parametrize(("theta_1", "slip"), [(0.0, 0.3), (1.57, 0.3), (0.7, -1.0), (0.7, 1.2)])
def test_held_at_the_edges(theta_1, slip):
    shift = IntegralShift(WHEEL, SAND)
    inside = shift.at(
        0.025, min(max(theta_1, THETA_1[0]), THETA_1[1]), min(max(slip, SLIP[0]), SLIP[1])
    )
    np.testing.assert_allclose(shift.at(0.025, theta_1, slip).value, inside.value)
