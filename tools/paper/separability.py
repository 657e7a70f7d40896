"""Beyond the paper: what torque and drawbar pull tell of cohesion and friction, and what the linear
model makes of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from gritd.estimator.filter.shift import IntegralShift
from gritd.estimator.model import balance
from gritd.estimator.stages.situation import ContactLaw
from gritd.estimator.terramechanics import linear
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.estimator.terramechanics.soils import (
    DRY_SAND,
    LOOSE_SAND,
    MARS_LIKE,
    SANDY_LOAM,
    NamedSoil,
)
from gritd.tools.paper.closed_forms import WHEEL, Lines


def separability() -> Lines:
    """c and tan φ act on T alike at every slip of one load, and differently at another load."""
    yield (
        "Beyond the paper. Dry sand: (∂T/∂c per 100 Pa) / (∂T/∂tan φ per 0.01) over slip 5-80 %, "
        "at one load"
    )
    slip = np.linspace(0.05, 0.8, 16)
    for load in (40.0, 70.0, 120.0):
        ratio = sensitivity_ratio(DRY_SAND, slip, load)
        yield f"  {load:5.0f} N   {ratio.min():.2f} … {ratio.max():.2f}"
    yield "  Slip does not separate them; load does.\n"


def sensitivity_ratio(named: NamedSoil, slip: Array, load: float) -> Array:
    """∂T/∂c per 100 Pa over ∂T/∂tan φ per 0.01 at each slip (n,), with the original model's θ₁."""
    soil = named.under(WHEEL.width)
    loads = np.full_like(slip, load)
    theta_1 = balance.solve(WHEEL, balance.Contact(soil, ContactLaw(0.5), slip, loads)).theta_1
    gradient = linear.predict_batch(
        WHEEL, soil.cohesion, soil.tan_phi, soil.shear_modulus, theta_1, slip, loads
    )
    return np.asarray(1e4 * gradient.torque_gradient[0] / gradient.torque_gradient[1])


LOW_COHESION = (
    DRY_SAND,
    SANDY_LOAM,
    LOOSE_SAND,
    MARS_LIKE,
)  # snow and clay carry the wheel otherwise: see docs


def fitted_soil() -> Lines:
    """c and tan φ that the closed forms find in forces of the original model, bare and with the
    true stresses.
    """
    yield (
        "(20)-(22) fitted to T and DP of the original model, loads 30-105 N, slips 5-60 %, no noise"
    )

    columns = f"{'bare':>8}{'shifted':>9}{'prior off':>11}"
    yield f"  {'':<12}{'c [Pa]':>8}{columns}    {'tan φ':>6}{columns}"

    for named in LOW_COHESION:
        soil = named.under(WHEEL.width)
        prior = replace(soil, cohesion=1.25 * soil.cohesion, tan_phi=0.95 * soil.tan_phi)

        soils = (
            fit(soil),
            fit(soil, IntegralShift(WHEEL, soil)),
            fit(soil, IntegralShift(WHEEL, prior)),
        )

        c = "".join(f"{x:>{width}.0f}" for (x, _), width in zip(soils, (8, 9, 11), strict=True))
        tan_phi = "".join(
            f"{x:>{width}.4f}" for (_, x), width in zip(soils, (8, 9, 11), strict=True)
        )
        yield (
            f"  {named.name:<12}{float(soil.cohesion):>8.0f}{c}    "
            f"{float(soil.tan_phi):>6.4f}{tan_phi}"
        )

    yield (
        "  The linearisation alone moves c by a quarter or more. "
        "The effect stress_linearisation removes it, also if"
    )
    yield (
        "  it was computed from a prior with c 25 % and tan φ 5 % wrong "
        "(estimator/filter/shift.py)."
    )


def fit(soil: Soil, shift: IntegralShift | None = None) -> tuple[float, float]:
    """Least-squares c [Pa] and tan φ, T weighed with 0.05 N·m and DP with 0.5 N; k is known."""
    load, slip = (
        grid.ravel() for grid in np.meshgrid((30.0, 55.0, 80.0, 105.0), np.linspace(0.05, 0.6, 6))
    )
    solved = balance.solve(WHEEL, balance.Contact(soil, ContactLaw(0.5), slip, load))
    k = float(soil.shear_modulus)
    conditions = [
        (theta_1, i, w, None if shift is None else shift.at(k, theta_1, i))
        for theta_1, i, w in zip(solved.theta_1.tolist(), slip.tolist(), load.tolist(), strict=True)
    ]

    def misfit(x: Array) -> Array:
        closed = [
            linear.predict(WHEEL, 1e3 * x[0], x[1], k, theta_1, i, w, shift=shifted)
            for theta_1, i, w, shifted in conditions
        ]
        torque = (np.array([p.torque for p in closed]) - solved.forces.torque) / 0.05
        pull = (np.array([p.drawbar_pull for p in closed]) - solved.forces.drawbar_pull) / 0.5
        return np.concatenate((torque, pull))

    solution = least_squares(misfit, [1.0, 0.5], bounds=([0.0, 0.0], [10.0, 2.0]), xtol=1e-12).x
    return 1e3 * float(solution[0]), float(solution[1])
