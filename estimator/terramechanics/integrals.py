"""The integrals A₁ … C₃ of the closed forms (20)-(22), and their derivatives.

`linear` has what they stand for, `moments` the kernels that they are made of. Each is divided by
θ₁: so they stay finite where the wheel hardly touches.
"""

from __future__ import annotations

from typing import NamedTuple

from gritd.estimator.terramechanics.moments import Kernels, Maths, OneSample, Value, kernels

NUMBERS: Maths = OneSample()
Both = tuple[Kernels, Kernels]  # without and with the factor e^(−iθ₁v)


class Integrals(NamedTuple):
    """A₁ … C₃ of linear.py, each divided by θ₁."""

    a1: Value
    a2: Value
    b1: Value
    b2: Value
    b3: Value
    c1: Value
    c2: Value
    c3: Value


def integrals(theta_1: Value, ratio: Value, f: Value, maths: Maths = NUMBERS) -> Integrals:
    """A₁ … C₃ over θ₁, for θ₁ [rad], ratio θₘ/θ₁ in [0, 1] and f [1/rad] of either sign."""
    return integrals_of(theta_1, f, both_kernels(theta_1, ratio, f, maths), maths)


def both_kernels(theta_1: Value, ratio: Value, f: Value, maths: Maths) -> Both:
    """The integrals without and with the factor e^(−iθ₁v)."""
    eta = abs(f) * theta_1
    straight = kernels(maths, theta_1, ratio, eta, turning=False)
    return straight, kernels(maths, theta_1, ratio, eta, turning=True)


def integrals_of(theta_1: Value, f: Value, both: Both, maths: Maths) -> Integrals:
    """A₁ … C₃ over θ₁. With θ = θ₁ − θ₁v, cos θ + i sin θ = e^(iθ₁) e^(−iθ₁v)."""
    straight, turning = both
    rotation = _rotation(theta_1, maths)
    sign = maths.sign(f)

    bare = rotation * turning.bare.hat
    one, hat = sign * rotation * turning.mobilised.one, sign * rotation * turning.mobilised.hat

    return Integrals(
        sign * straight.mobilised.one, sign * straight.mobilised.hat,
        bare.real, one.imag, hat.imag,
        one.real, hat.real, bare.imag,
    )  # fmt: skip


def theta_1_derivative(
    theta_1: Value, f: Value, x: Integrals, both: Both, maths: Maths
) -> tuple[Integrals, Integrals]:
    """Derivatives of θ₁x and of x with respect to θ₁ at fixed θₘ/θ₁ and f."""
    straight, turning = both
    rotation = _rotation(theta_1, maths)
    spin = 1j * rotation
    signed = maths.sign(f) * spin
    bare = spin * (turning.bare.hat - turning.bare.hat_v)
    one = f * rotation * turning.decayed.v + signed * (turning.mobilised.one - turning.mobilised.v)
    hat = f * rotation * turning.decayed.hat_v + signed * (
        turning.mobilised.hat - turning.mobilised.hat_v
    )
    dx = Integrals(
        f * straight.decayed.v, f * straight.decayed.hat_v,
        bare.real, one.imag, hat.imag,
        one.real, hat.real, bare.imag,
    )  # fmt: skip

    return Integrals(*(value + theta_1 * slope for value, slope in zip(x, dx, strict=True))), dx


def f_derivative(theta_1: Value, both: Both, maths: Maths) -> tuple[Integrals, Integrals]:
    """Derivatives of θ₁x and of x with respect to f; even in f."""
    straight, turning = both
    rotation = theta_1 * _rotation(theta_1, maths)
    one, hat = rotation * turning.decayed.v, rotation * turning.decayed.hat_v
    dx = Integrals(
        theta_1 * straight.decayed.v, theta_1 * straight.decayed.hat_v,
        0.0, one.imag, hat.imag,
        one.real, hat.real, 0.0,
    )  # fmt: skip
    return Integrals(*(theta_1 * slope for slope in dx)), dx


def ratio_derivative(
    theta_1: Value, f: Value, both: Both, maths: Maths
) -> tuple[Integrals, Integrals]:
    """Derivatives of θ₁x and of x with respect to θₘ/θ₁."""
    straight, turning = both
    rotation = _rotation(theta_1, maths)
    sign = maths.sign(f)
    bare, hat = rotation * turning.bare.shift, sign * rotation * turning.mobilised.shift

    dx = Integrals(
        0.0, sign * straight.mobilised.shift,
        bare.real, 0.0, hat.imag,
        0.0, hat.real, bare.imag,
    )  # fmt: skip
    return Integrals(*(theta_1 * slope for slope in dx)), dx


def _rotation(theta_1: Value, maths: Maths) -> Value:
    return maths.cos(theta_1) + 1j * maths.sin(theta_1)
