"""`linear.predict` for one sample, spelled out: the loop and the replay spend most of their time
here.

With v = (θ₁ − θ)/θ₁ from 0 at entry to 1 at bottom dead centre, and hat(v) the triangle of (11),
(12) with its peak at v = α = 1 − λ, λ = θₘ/θ₁, the integrals of (20)-(22) are values of two Laplace
transforms,

    E(s) = ∫₀¹ e^(−sv) dv = (1 − e^(−s))/s
    H(s) = ∫₀¹ hat(v) e^(−sv) dv = [1/α − e^(−αs)/(αλ) + e^(−s)/λ]/s²

at s = η = fθ₁, iθ₁ and η + iθ₁, because cos θ + i sin θ = e^(iθ₁) e^(−iθ₁v). They lose digits as s
→ 0 and as θₘ nears an end of the contact, and f < 0 is braking: there `linear`, stable in every
limit, gives the answer.
"""

from __future__ import annotations

from cmath import exp as turn
from math import exp, sin
from typing import Any

from gritd.estimator.terramechanics import integrals, linear
from gritd.estimator.terramechanics.linear import ClosedFormPrediction, Shift
from gritd.estimator.terramechanics.soil import Wheel

SMALLEST = 0.1  # of |s|: below it a derivative of H has lost four digits
NEAREST = 0.02  # likewise of λ and of 1 − λ

Number = Any  # real or complex: the transforms are the same
Integrals = tuple[float, float, complex, complex, complex]  # see _integrals
Change = tuple[float, float, float, float]  # of T, DP, resistance, W
NONE: Change = (0.0, 0.0, 0.0, 0.0)
NOTHING: Integrals = (0.0, 0.0, 0j, 0j, 0j)


def predict(
    wheel: Wheel,
    c: float,
    tan_phi: float,
    k: float,
    theta_1: float,
    slip: float,
    load: float,
    shift: Shift | None = None,
) -> ClosedFormPrediction:
    """T, DP, resistance and σₘ under a load W, with gradients: arguments and result are those of
    `linear.predict`.
    """
    lam = wheel.c1 + wheel.c2 * slip
    half, scale = sin(0.5 * theta_1), wheel.radius / k
    rise = half * half
    f = scale * (slip + (1.0 - slip) * rise)  # Eq. (19)
    if _delicate(theta_1, f, slip, lam):
        return linear.predict(wheel, c, tan_phi, k, theta_1, slip, load, shift=shift)
    x, by_theta_1, by_f = _integrals(theta_1, f * theta_1, lam)
    if shift is not None:
        x, by_theta_1 = _added(x, shift.value, 1.0), _added(by_theta_1, shift.theta_1, theta_1)
    a1, a2, bare, one, hat = x
    area, arm = wheel.radius * wheel.width, wheel.radius * wheel.radius * wheel.width
    cohesion, carry = c * theta_1, bare.real + tan_phi * hat.imag
    s = (load / area - cohesion * one.imag) / carry  # σₘθ₁ by Eq. (21)
    friction = s * tan_phi

    def forces(a1: float, a2: float, bare: complex, one: complex, hat: complex) -> Change:
        """Eqs. (20)-(22) at this s: linear in the integrals, so that changes of both follow the
        same formulas.
        """
        drag = area * s * bare.imag
        return (
            arm * (cohesion * a1 + friction * a2),
            area * (cohesion * one.real + friction * hat.real) - drag,
            drag,
            area * (cohesion * one.imag + s * bare.real + friction * hat.imag),
        )

    columns = [
        (arm * theta_1 * a1, area * theta_1 * one.real, 0.0, area * theta_1 * one.imag),
        (arm * s * a2, area * s * hat.real, 0.0, area * s * hat.imag),
        forces(*by_f),
        forces(
            a1 + by_theta_1[0], by_theta_1[1], by_theta_1[2], one + by_theta_1[3], by_theta_1[4]
        ),
        forces(*_by_ratio(theta_1, f * theta_1, lam)),
        *(
            [forces(*_added(NOTHING, by, 1.0)) for by in shift[2:]]
            if shift is not None
            else [NONE] * 4
        ),
    ]
    # s gives way to each of them so that W stays the same
    ds = -1.0 / (area * carry)
    torque_s, drag_s = arm * tan_phi * a2 * ds, area * bare.imag * ds
    pull_s = area * tan_phi * hat.real * ds - drag_s
    by_c, by_tan_phi, by_ln_f, by_ln_theta_1, by_lam, by_slip, by_ln_k, by_n, by_peak = [
        (torque + torque_s * load, pull + pull_s * load, drag + drag_s * load)
        for torque, pull, drag, load in columns
    ]
    # of ln f by θ₁ and by i
    f_theta_1, f_slip = 0.5 * scale * (1.0 - slip) * sin(theta_1) / f, scale * (1.0 - rise) / f
    torque, pull, drag, _ = forces(*x)
    gradients = [
        (
            by_c[q],
            by_tan_phi[q],
            by_ln_k[q] - by_ln_f[q],
            by_ln_theta_1[q] / theta_1 + f_theta_1 * by_ln_f[q],
            by_slip[q] + f_slip * by_ln_f[q] + wheel.c2 * by_lam[q],
            -by_w,
            by_n[q],
            by_lam[q] + by_peak[q],
        )
        for q, by_w in enumerate((torque_s, pull_s, drag_s))
    ]
    return ClosedFormPrediction(torque, pull, drag, s / theta_1, *gradients)


def load(
    wheel: Wheel,
    c: float,
    tan_phi: float,
    k: float,
    theta_1: float,
    slip: float,
    sigma_m: float,
    shift: Shift | None = None,
) -> float:
    """W [N] by Eq. (21) for a given peak stress σₘ [Pa]: that of `linear.forces`."""
    lam = wheel.c1 + wheel.c2 * slip
    half = sin(0.5 * theta_1)
    f = wheel.radius / k * (slip + (1.0 - slip) * (half * half))  # Eq. (19)

    if _delicate(theta_1, f, slip, lam):
        return float(linear.forces(wheel, c, tan_phi, k, theta_1, slip, sigma_m, shift=shift).load)

    x, _, _ = _integrals(theta_1, f * theta_1, lam)
    _, _, bare, one, hat = x if shift is None else _added(x, shift.value, 1.0)
    supported = sigma_m * (bare.real + tan_phi * hat.imag) + c * one.imag
    return wheel.radius * wheel.width * theta_1 * supported


def _delicate(theta_1: float, f: float, slip: float, lam: float) -> bool:
    """Whether the transforms would lose digits here."""
    return (
        slip < 0.0
        or theta_1 < SMALLEST
        or f * theta_1 < SMALLEST
        or not NEAREST < lam < 1.0 - NEAREST
    )


def _added(x: Integrals, change: integrals.Integrals, factor: float) -> Integrals:
    """The integrals with a multiple of eight real ones added."""
    a1, a2, b1, b2, b3, c1, c2, c3 = change
    return (
        x[0] + factor * a1,
        x[1] + factor * a2,
        x[2] + factor * complex(b1, c3),
        x[3] + factor * complex(c1, b2),
        x[4] + factor * complex(c2, b3),
    )


def _integrals(theta_1: float, eta: float, lam: float) -> tuple[Integrals, Integrals, Integrals]:
    """A₁, A₂, B₁ + iC₃, C₁ + iB₂, C₂ + iB₃ of linear.py, and their derivatives by ln θ₁, at fixed
    f, and by ln f.
    """
    turning, both = 1j * theta_1, complex(eta, theta_1)
    alpha, ahead = 1.0 - lam, turn(turning)
    e0, h0, e0_s, h0_s = _transforms(eta, exp(-eta), exp(-eta * alpha), lam)
    e1, h1, e1_s, h1_s = _transforms(turning, turn(-turning), turn(-turning * alpha), lam)
    e2, h2, e2_s, h2_s = _transforms(both, turn(-both), turn(-both * alpha), lam)
    bare, one, hat = ahead * h1, ahead * (e1 - e2), ahead * (h1 - h2)
    share = -ahead * (eta / both)

    return (
        (1.0 - e0, 0.5 - h0, bare, one, hat),
        (-e0_s, -h0_s, turning * bare + ahead * h1_s, turning * one + ahead * (e1_s - e2_s),
         turning * hat + ahead * (h1_s - h2_s)),
        (-e0_s, -h0_s, 0j, share * e2_s, share * h2_s),
    )  # fmt: skip


def _transforms(
    s: Number, end: Number, peak: Number, lam: float
) -> tuple[Number, Number, Number, Number]:
    """E, H, s dE/ds and s dH/ds; end = e^(−s), peak = e^(−αs)."""
    one = (1.0 - end) / s
    fall = (peak - end) / lam
    hat = ((1.0 - peak) / (1.0 - lam) - fall) / (s * s)
    return one, hat, end - one, fall / s - 2.0 * hat


def _by_ratio(theta_1: float, eta: float, lam: float) -> Integrals:
    """Derivatives of the integrals by λ."""
    ahead, alpha = turn(1j * theta_1), 1.0 - lam

    def hat_lam(s: complex) -> complex:
        peak = turn(-s * alpha)
        lost = (1.0 - peak) / alpha - s * peak
        return (lost / alpha + ((peak - turn(-s)) / lam - s * peak) / lam) / (s * s)

    bare = ahead * hat_lam(1j * theta_1)
    return 0.0, -hat_lam(complex(eta)).real, bare, 0j, bare - ahead * hat_lam(complex(eta, theta_1))
