"""The linear model, Eqs. (11)-(22): triangular stresses, and forces in closed form.

The printed paper has misprints in (6), (18) and (22); the forms here are right
(docs/physics.md). With

    σ(θ) = σₘ·hat(θ), the triangle of (11), (12)
    τ(θ) = (c + σ tan φ) g(θ),   g = 1 − e^(−f(θ₁ − θ))

the integrals (15)-(17) are linear in c, σₘ and σₘ tan φ:

    T  = r²b [c·A₁ + σₘ tan φ·A₂]           (22)
    W  = r b [σₘ(B₁ + tan φ·B₃) + c·B₂]     (21)
    DP = r b [c·C₁ + σₘ(tan φ·C₂ − C₃)]     (20)

    A₁ = ∫ g dθ,                A₂ = ∫ hat g dθ
    B₁ = ∫ hat cos θ dθ,        B₂, B₃ = ∫ {1, hat} g sin θ dθ
    C₁, C₂ = ∫ {1, hat} g cos θ dθ,   C₃ = ∫ hat sin θ dθ

`predict` eliminates σₘ through (21), so a wheel of known load needs neither n nor K. Where f < 0
(braking) the shear stress is the odd extension, τ(−f) = −τ(f). Valid for 0 ≤ θ₁ ≤ π/2, −1 < i ≤
1. The functions take numbers; `predict_batch` takes arrays, and the others do too when given
`ARRAYS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gritd.estimator.terramechanics.integrals import (
    NUMBERS,
    Integrals,
    both_kernels,
    f_derivative,
    integrals,
    integrals_of,
    ratio_derivative,
    theta_1_derivative,
)
from gritd.estimator.terramechanics.moments import Arrays, Maths, Value
from gritd.estimator.terramechanics.original import LOCKED
from gritd.estimator.terramechanics.soil import Array, Scalar, Wheel

ARRAYS: Maths = Arrays()

# order of every gradient below; peak: θₘ/θ₁ of (5), at any slip
GRADIENT = ("c", "tan_phi", "ln_k", "theta_1", "slip", "load", "exponent", "peak")


class Exponent(NamedTuple):
    """f of (19) and its derivatives."""

    f: Value  # [1/rad]
    theta_1: Value
    slip: Value


class Shift(NamedTuple):
    """What another stress distribution adds to A₁ … C₃, and its derivatives (see
    estimator/filter/shift.py).
    """

    value: Integrals
    theta_1: Integrals
    slip: Integrals
    ln_k: Integrals
    exponent: Integrals
    peak: Integrals


class ClosedFormPrediction(NamedTuple):
    """What the closed forms say of a wheel under load, and the gradients in the order of
    GRADIENT.
    """

    torque: Value  # T [N·m]
    drawbar_pull: Value  # DP [N]
    resistance: Value  # second term of (20), r b σₘ C₃ [N]
    sigma_m: Value  # [Pa]; infinite at θ₁ = 0
    torque_gradient: tuple[Value, ...]
    drawbar_pull_gradient: tuple[Value, ...]
    resistance_gradient: tuple[Value, ...]


class LinearForces(NamedTuple):
    """What the soil does to the wheel."""

    drawbar_pull: Value  # DP [N], Eq. (20)
    load: Value  # W [N], Eq. (21)
    torque: Value  # T [N·m], Eq. (22)
    resistance: Value  # second term of (20) [N]


def predict(
    wheel: Wheel,
    c: Value,
    tan_phi: Value,
    k: Value,
    theta_1: Value,
    slip: Value,
    load: Value,
    maths: Maths = NUMBERS,
    shift: Shift | None = None,
) -> ClosedFormPrediction:
    """T, DP, resistance and σₘ under a load W, with gradients with respect to GRADIENT. Eqs.
    (20)-(22), (19), (5).

    c [Pa], tan φ [-], k [m], θ₁ [rad], i [-], W [N], all floats. With a shift the forces are
    those of the stresses it stands for.
    """
    ratio, inside = _peak_ratio(wheel, slip, maths)
    exponent = shear_exponent(wheel, k, theta_1, slip, maths)
    both = both_kernels(theta_1, ratio, exponent.f, maths)
    bare = integrals_of(theta_1, exponent.f, both, maths)
    x = _added(bare, shift.value) if shift else bare
    s = _scaled_peak(wheel, x, c, tan_phi, theta_1, load)

    at = _At(wheel, x, tan_phi, s)
    by_theta_1 = at.along(c, *theta_1_derivative(theta_1, exponent.f, bare, both, maths))
    by_f = at.along(c, *f_derivative(theta_1, both, maths))
    by_ratio = at.along(c, *ratio_derivative(theta_1, exponent.f, both, maths))
    columns: tuple[Sequence[Value], ...] = (
        at.response(-theta_1 * x.b2, theta_1 * x.a1, theta_1 * x.c1, 0.0),
        at.response(-s * x.b3, s * x.a2, s * x.c2, 0.0),
        [-exponent.f * by for by in by_f],
        [by + exponent.theta_1 * f for by, f in zip(by_theta_1, by_f, strict=True)],
        [exponent.slip * f + wheel.c2 * inside * by for f, by in zip(by_f, by_ratio, strict=True)],
        at.response(1.0 / (wheel.radius * wheel.width), 0.0, 0.0, 0.0),
        [0.0 * by for by in by_ratio],
        [inside * by for by in by_ratio],
    )
    if shift:
        columns = tuple(map(_summed, columns, at.along_shift(c, theta_1, shift)))
    forces = _forces(wheel, x, c * theta_1, tan_phi, s)
    gradients = tuple(zip(*columns, strict=True))
    return ClosedFormPrediction(
        forces.torque, forces.drawbar_pull, forces.resistance, maths.divide(s, theta_1), *gradients
    )


def predict_batch(
    wheel: Wheel, c: Scalar, tan_phi: Scalar, k: Scalar, theta_1: Scalar, slip: Scalar, load: Scalar
) -> ClosedFormPrediction:
    """`predict` for arrays: every argument a float or (n,); every field, and every entry of a
    gradient, (n,).
    """
    c, tan_phi, k, theta_1, slip, load = np.broadcast_arrays(c, tan_phi, k, theta_1, slip, load)
    prediction = predict(wheel, c, tan_phi, k, theta_1, slip, load, ARRAYS)

    shape = np.shape(c)
    gradients = (
        tuple(np.broadcast_to(entry, shape) for entry in gradient) for gradient in prediction[4:]
    )
    return ClosedFormPrediction(*prediction[:4], *gradients)


def forces_under_load(
    wheel: Wheel,
    c: Value,
    tan_phi: Value,
    k: Value,
    theta_1: Value,
    slip: Value,
    load: Value,
    maths: Maths = NUMBERS,
    shift: Shift | None = None,
) -> LinearForces:
    """`predict` without gradients: a third of its cost, for a search over slip."""
    x = _wheel_integrals(wheel, k, theta_1, slip, maths, shift)

    return _forces(
        wheel, x, c * theta_1, tan_phi, _scaled_peak(wheel, x, c, tan_phi, theta_1, load)
    )


def forces(
    wheel: Wheel,
    c: Value,
    tan_phi: Value,
    k: Value,
    theta_1: Value,
    slip: Value,
    sigma_m: Value,
    maths: Maths = NUMBERS,
    shift: Shift | None = None,
) -> LinearForces:
    """DP, W, T and resistance for a given peak stress σₘ [Pa]. Eqs. (20)-(22)."""
    x = _wheel_integrals(wheel, k, theta_1, slip, maths, shift)

    return _forces(wheel, x, c * theta_1, tan_phi, sigma_m * theta_1)


def shear_exponent(
    wheel: Wheel, k: Value, theta_1: Value, slip: Value, maths: Maths = NUMBERS
) -> Exponent:
    """f of (19): (r/2k)[(1 + i) − (1 − i) cos θ₁], the mean of −dj/dθ / k at θ = 0 and θ = θ₁.

    With the velocity ratio v/(rω) = 1 − lag in place of 1 − i it holds for braking too; it is
    written so that it keeps its digits as i and θ₁ go to zero.
    """
    q = maths.clip(1.0 + slip, LOCKED, 1.0)  # 1 when driving, 1 + i when braking
    lag = slip / q
    half = maths.sin(0.5 * theta_1)
    scale = wheel.radius / k

    return Exponent(
        scale * (lag + (1.0 - lag) * half * half),
        scale * 0.5 * (1.0 - lag) * maths.sin(theta_1),
        scale * (1.0 - half * half) / (q * q),
    )


def normal_stress(theta_1: Scalar, theta_m: Scalar, sigma_m: Scalar, theta: Scalar) -> Array:
    """Triangular σ [Pa] at θ [rad], Eqs. (11) and (12); numbers, or arrays of one shape (n,)."""
    front, rear = (
        np.subtract(theta_1, theta) / np.subtract(theta_1, theta_m),
        np.divide(theta, theta_m),
    )
    return np.asarray(sigma_m * np.maximum(np.minimum(front, rear), 0.0))


def tau_m(
    wheel: Wheel, c: Value, tan_phi: Value, k: Value, theta_1: Value, slip: Value, sigma_m: Value
) -> Value:
    """Largest shear stress τₘ [Pa] with the linearised exponent, Eqs. (18) and (19); for
    numbers.
    """
    ratio, _ = _peak_ratio(wheel, slip, NUMBERS)
    f = shear_exponent(wheel, k, theta_1, slip).f
    g = -NUMBERS.expm1(-abs(f) * theta_1 * (1.0 - ratio))
    return (c + sigma_m * tan_phi) * NUMBERS.sign(f) * g


def _peak_ratio(wheel: Wheel, slip: Value, maths: Maths) -> tuple[Value, Value]:
    """θₘ/θ₁ of (5), kept inside [0, 1], and 1 where it is inside, else 0."""
    free = wheel.c1 + wheel.c2 * slip
    ratio = maths.clip(free, 0.0, 1.0)
    return ratio, 1.0 * (ratio == free)


def _wheel_integrals(
    wheel: Wheel, k: Value, theta_1: Value, slip: Value, maths: Maths, shift: Shift | None
) -> Integrals:
    """A₁ … C₃ of a wheel, with the shift if there is one."""
    f = shear_exponent(wheel, k, theta_1, slip, maths).f
    x = integrals(theta_1, _peak_ratio(wheel, slip, maths)[0], f, maths)
    return _added(x, shift.value) if shift else x


def _scaled_peak(
    wheel: Wheel, x: Integrals, c: Value, tan_phi: Value, theta_1: Value, load: Value
) -> Value:
    """σₘθ₁ [Pa·rad] that carries the load W, Eq. (21); unlike σₘ it is finite at θ₁ = 0."""
    return (load / (wheel.radius * wheel.width) - c * theta_1 * x.b2) / (x.b1 + tan_phi * x.b3)


def _forces(wheel: Wheel, x: Integrals, c: Value, tan_phi: Value, s: Value) -> LinearForces:
    """Eqs. (20)-(22) for c·θ₁ and s = σₘθ₁ [Pa·rad]."""
    area = wheel.radius * wheel.width
    resistance = area * s * x.c3
    drawbar_pull = area * (c * x.c1 + s * tan_phi * x.c2) - resistance  # Eq. (20)
    load = area * (s * (x.b1 + tan_phi * x.b3) + c * x.b2)  # Eq. (21)
    torque = wheel.radius * area * (c * x.a1 + s * tan_phi * x.a2)  # Eq. (22)
    return LinearForces(drawbar_pull, load, torque, resistance)


def _added(x: Integrals, change: Integrals) -> Integrals:
    return Integrals(*[a + b for a, b in zip(x, change, strict=True)])


def _summed(column: Sequence[Value], change: Sequence[Value]) -> list[Value]:
    return [a + b for a, b in zip(column, change, strict=True)]


class _At(NamedTuple):
    """The point at which (20)-(22), with s = σₘθ₁ from (21), are differentiated."""

    wheel: Wheel
    x: Integrals
    tan_phi: Value
    s: Value

    def response(
        self, support: Value, torque: Value, pull: Value, resistance: Value
    ) -> tuple[Value, Value, Value]:
        """Change of T, DP and resistance, in units of rb (T: r²b), from their own terms and
        through s.

        support: what (21) leaves for s·(B₁ + tan φ B₃) to carry, changed.
        """
        x, area = self.x, self.wheel.radius * self.wheel.width
        ds = support / (x.b1 + self.tan_phi * x.b3)
        drag = area * (resistance + x.c3 * ds)
        friction = self.tan_phi * ds

        return (
            self.wheel.radius * area * (torque + x.a2 * friction),
            area * (pull + x.c2 * friction) - drag,
            drag,
        )

    def along(self, c: Value, cohesive: Integrals, dx: Integrals) -> tuple[Value, Value, Value]:
        """`response` to a change of the integrals: `cohesive` that of θ₁x, which c multiplies,
        and dx that of x.
        """
        s, friction = self.s, self.tan_phi * self.s
        return self.response(
            -c * cohesive.b2 - s * dx.b1 - friction * dx.b3,
            c * cohesive.a1 + friction * dx.a2,
            c * cohesive.c1 + friction * dx.c2,
            s * dx.c3,
        )

    def along_shift(self, c: Value, theta_1: Value, shift: Shift) -> tuple[Sequence[Value], ...]:
        """What a shift adds to the columns of the gradient, in the order of GRADIENT."""
        none = (0.0, 0.0, 0.0)
        grown = Integrals(
            *[a + theta_1 * b for a, b in zip(shift.value, shift.theta_1, strict=True)]
        )
        by_ln_k, by_slip, by_exponent, by_peak = (
            self.along(c, Integrals(*[theta_1 * d for d in dx]), dx)
            for dx in (shift.ln_k, shift.slip, shift.exponent, shift.peak)
        )
        by_theta_1 = self.along(c, grown, shift.theta_1)
        return none, none, by_ln_k, by_theta_1, by_slip, none, by_exponent, by_peak
