"""The closed forms of the linear model against the integrals they solve, and its shear stress
against the original's (Fig. 3).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.terramechanics import linear, original
from gritd.estimator.terramechanics.original import arc, contact, janosi, shear_displacement
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel
from gritd.estimator.terramechanics.soils import DRY_SAND

WHEEL = Wheel(radius=0.072, width=0.071)
DRAWS = 2_000

Lines = Iterator[str]


def closed_forms(seed: int) -> Lines:
    """The closed forms (20)-(22) against quadrature of the integrals (15)-(17) they solve."""
    yield (
        "Closed forms (20)-(22), corrected, against Gauss-Legendre quadrature of (15)-(17), "
        f"{DRAWS} random draws"
    )

    differences = closed_form_differences(seed)
    for name, values in differences.items():
        yield f"  {name:<3} largest difference {values.max():.1e}   median {np.median(values):.1e}"
    yield (
        "  relative to W, and to r·W for T. Printed (6), (18) and (22) have misprints: "
        "docs/physics.md.\n"
    )


def closed_form_differences(seed: int) -> dict[str, Array]:
    """|closed form − quadrature| of T, W and DP, relative to rW and W; each (DRAWS,)."""
    rng = np.random.default_rng(seed)
    c, tan_phi, k = (
        rng.uniform(0, 5e3, DRAWS),
        rng.uniform(0.2, 0.9, DRAWS),
        rng.uniform(0.005, 0.05, DRAWS),
    )
    theta_1, slip = rng.uniform(0.1, 1.2, DRAWS), rng.uniform(-0.3, 0.9, DRAWS)
    sigma_m = rng.uniform(1e3, 1e5, DRAWS)

    ours = linear.forces(WHEEL, c, tan_phi, k, theta_1, slip, sigma_m, linear.ARRAYS)
    f = linear.shear_exponent(WHEEL, k, theta_1, slip, linear.ARRAYS).f
    theirs = original.integrate(WHEEL, triangular_contact(theta_1, slip, f, sigma_m, c, tan_phi))

    return {
        "T": np.abs(ours.torque - theirs.torque) / (WHEEL.radius * theirs.load),
        "W": np.abs(ours.load / theirs.load - 1),
        "DP": np.abs(ours.drawbar_pull - theirs.drawbar_pull) / theirs.load,
    }


def triangular_contact(
    theta_1: Array, slip: Array, f: Array, sigma_m: Array, c: Array, tan_phi: Array
) -> original.ContactStresses:
    """The stresses [Pa] of the linear model at quadrature nodes: triangular σ, and τ with the
    exponent f(θ₁ − θ). All arguments (n,): angles [rad], σₘ and c [Pa].
    """
    any_soil = Soil(0.0, 0.0, 1.0, 1.0, 1.0)
    nodes = contact(WHEEL, any_soil, theta_1, slip, order=48)
    sigma = linear.normal_stress(theta_1, 0.5 * theta_1, sigma_m, theta_1 - nodes.points.turned)
    return nodes._replace(sigma=sigma, tau=(c + sigma * tan_phi) * janosi(f * nodes.points.turned))


def figure_3() -> Lines:
    """The exponent j/k of (7) against its linearisation f(θ₁ − θ)."""
    yield (
        "Fig. 3: exponent of the shear stress, j/k of (6) against f(θ₁ − θ) of (19); dry sand, "
        "r 72 mm, θ₁ 45°"
    )
    yield "  (the paper shows a figure and prints no number)"
    yield (
        "  slip   θ/θ₁:  "
        + "".join(f"{share:>16.2f}" for share in (0.0, 0.25, 0.5, 0.75))
        + "   largest gap in 1−e^−x"
    )

    for slip in (0.05, 0.2, 0.5, 0.8):
        exact, straight = exponents(slip)
        cells = "".join(f"{exact[at]:>8.3f}{straight[at]:>8.3f}" for at in (0, 25, 50, 75))
        gap = np.max(np.abs(janosi(exact) - janosi(straight)))
        yield f"  {slip:4.2f}   j/k, f·x  {cells}   {gap:.3f}"

    yield ""


def exponents(slip: float, theta_1: float = np.pi / 4) -> tuple[Array, Array]:
    """j/k and f(θ₁ − θ) at θ/θ₁ = 0, 0.01 … 1, each (101,); θ₁ [rad]."""
    k = float(DRY_SAND.shear_modulus)
    points = arc(theta_1, theta_1 * np.linspace(0.0, 1.0, 101))
    exact = shear_displacement(WHEEL, slip, points) / k
    return exact, linear.shear_exponent(WHEEL, k, theta_1, slip).f * points.turned
