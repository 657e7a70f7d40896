"""The integrals that the closed forms (20)-(22) are made of, stable in every limit.

Along the contact let v = (θ₁ − θ)/θ₁ run from 0 at entry to 1 at bottom dead centre. The normal
stress of (11), (12) is σₘ·hat(v), a triangle with its peak at v = 1 − λ, λ = θₘ/θ₁. All
integrals of the linear model are then of the form

    ∫₀¹ {1, v, hat, v·hat} · kernel(v) dv
    kernel = e^(−ηv) or 1 − e^(−ηv), each with or without e^(−iθ₁v),

with η = |f|θ₁. On each side of the peak they reduce to moments over s ∈ [0, 1],

    μₙ(y) = ∫₀¹ sⁿ e^(−ys) ds   and   δₙ = μₙ(y) − μₙ(y + η) = ∫₀¹ sⁿ e^(−ys)(1 − e^(−ηs)) ds.

Integration by parts gives for both a recurrence in n. Forward it is the closed form; for small
|y + η|, where the closed form loses its digits, it is run backward, which converges to the last
digit in BACKWARD steps. In both directions δₙ carries η as a factor, so that nothing is lost as
f → 0.

The same arithmetic serves numbers (`OneSample`, for the loop) and arrays (`Arrays`, for batches).
"""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.terramechanics.soil import Array

SMALL = 0.25  # |y + η| below which the recurrence runs backward
# where it starts; what is left out there weighs SMALL¹¹/11! of it, below 1e-14, in μ₀
BACKWARD = 11

# A real or complex number, or an array of them: the arithmetic below is the same for all.
Value = Any
Triple = tuple[Value, Value, Value]


class Folded(NamedTuple):
    """One kernel integrated over the whole contact."""

    one: Value  # ∫ kernel dv
    v: Value  # ∫ v kernel dv
    hat: Value  # ∫ hat kernel dv
    hat_v: Value  # ∫ hat v kernel dv
    shift: Value  # ∂/∂λ of ∫ hat kernel dv


class Kernels(NamedTuple):
    """The three kernels, all with the factor e^(−iθ₁v) or all without."""

    bare: Folded  # 1
    mobilised: Folded  # 1 − e^(−ηv)
    decayed: Folded  # e^(−ηv)


class Maths(Protocol):
    """What differs between numbers and arrays."""

    def sin(self, x: Value) -> Value: ...
    def cos(self, x: Value) -> Value: ...
    def expm1(self, x: Value) -> Value: ...
    def sign(self, x: Value) -> Value: ...
    def clip(self, x: Value, low: float, high: float) -> Value: ...
    def divide(self, a: Value, b: Value) -> Value: ...
    def straight(self, eta: Value) -> tuple[Triple, Triple]: ...
    def turning(self, angle: Value, eta: Value) -> tuple[Triple, Triple]: ...


def kernels(maths: Maths, theta_1: Value, lam: Value, eta: Value, *, turning: bool) -> Kernels:
    """Integrals over the contact of the three kernels; `turning` gives them the factor
    e^(−iθ₁v).
    """
    alpha = 1.0 - lam
    lost = -maths.expm1(-eta * alpha)  # 1 − e^(−ηv) at the peak

    if turning:
        front, rear = (
            maths.turning(theta_1 * alpha, eta * alpha),
            maths.turning(theta_1 * lam, eta * lam),
        )
        angle = theta_1 * alpha
        phase = maths.cos(angle) - 1j * maths.sin(angle)
    else:
        front, rear = maths.straight(eta * alpha), maths.straight(eta * lam)
        phase = 1.0

    (m0, m1, m2), (d0, d1, d2) = front
    (r0, r1, r2), (e0, e1, e2) = rear
    n0, n1, n2 = r0 - e0, r1 - e1, r2 - e2
    kept = phase * (1.0 - lost)

    return Kernels(
        fold(lam, m0, m1, m2, phase * r0, phase * r1, phase * r2),
        fold(
            lam,
            d0,
            d1,
            d2,
            phase * (e0 + lost * n0),
            phase * (e1 + lost * n1),
            phase * (e2 + lost * n2),
        ),
        fold(lam, m0 - d0, m1 - d1, m2 - d2, kept * n0, kept * n1, kept * n2),
    )


def fold(lam: Value, m0: Value, m1: Value, m2: Value, r0: Value, r1: Value, r2: Value) -> Folded:
    """Join the moments of the front side (v = (1 − λ)s, hat = s) and of the rear side (v = 1 − λ
    + λs, hat = 1 − s).
    """
    alpha = 1.0 - lam
    fall = r0 - r1

    return Folded(
        alpha * m0 + lam * r0,
        alpha * alpha * m1 + lam * (alpha * r0 + lam * r1),
        alpha * m1 + lam * fall,
        alpha * alpha * m2 + lam * (alpha * fall + lam * (r1 - r2)),
        m1 - fall,
    )


def forward(mu: Triple, y: Value, eta: Value, step: Value) -> Triple:
    """δ₀, δ₁, δ₂ by the recurrence (y + η)δₙ = n δₙ₋₁ + η μₙ − e^(−y)(1 − e^(−η)): the closed
    form.
    """
    total = y + eta
    d0 = (eta * mu[0] - step) / total
    d1 = (d0 + eta * mu[1] - step) / total
    return d0, d1, (2.0 * d1 + eta * mu[2] - step) / total


def backward(y: Value, eta: Value, end: Value, step: Value) -> tuple[Triple, Triple]:
    """μ₀…μ₂ and δ₀…δ₂ for small |y + η|, by the same recurrences from n = BACKWARD down."""
    total = y + eta
    mu, delta = _MU_0[BACKWARD] * end, _MU_0[BACKWARD + 1] * step
    for reciprocal in _DOWN:
        delta = (total * delta - eta * mu + step) * reciprocal
        mu = (y * mu + end) * reciprocal
    d1 = 0.5 * (total * delta - eta * mu + step)
    m1 = 0.5 * (y * mu + end)
    return (y * m1 + end, m1, mu), (total * d1 - eta * m1 + step, d1, delta)


_MU_0 = tuple(1.0 / (n + 1) for n in range(BACKWARD + 2))  # μₙ(0)
_STRAIGHT: Triple = (_MU_0[0], _MU_0[1], _MU_0[2])
_DOWN = _MU_0[BACKWARD - 1 : 1 : -1]


class OneSample:
    """One sample, in plain floats and complex numbers."""

    sin = staticmethod(math.sin)
    cos = staticmethod(math.cos)
    expm1 = staticmethod(math.expm1)

    @staticmethod
    def sign(x: float) -> float:
        return math.copysign(1.0, x)

    @staticmethod
    def clip(x: float, low: float, high: float) -> float:
        return min(max(x, low), high)

    @staticmethod
    def divide(a: float, b: float) -> float:
        return a / b if b else math.copysign(math.inf, a)

    @staticmethod
    def straight(eta: float) -> tuple[Triple, Triple]:
        """μ and δ at y = 0."""
        step = -math.expm1(-eta)
        if eta < SMALL:
            return backward(0.0, eta, 1.0, step)
        return _STRAIGHT, forward(_STRAIGHT, 0.0, eta, step)

    @staticmethod
    def turning(angle: float, eta: float) -> tuple[Triple, Triple]:
        """μ and δ at y = i·angle."""
        y, end = 1j * angle, cmath.exp(-1j * angle)
        step = -math.expm1(-eta) * end
        if angle < SMALL:
            mu, delta = backward(y, eta, end, step)
            return (
                (mu, delta) if math.hypot(angle, eta) < SMALL else (mu, forward(mu, y, eta, step))
            )

        half = 0.5 * angle
        m0 = cmath.exp(-1j * half) * (math.sin(half) / half)
        m1 = (m0 - end) / y
        mu = (m0, m1, (2.0 * m1 - end) / y)

        return mu, forward(mu, y, eta, step)


class Arrays:
    """Many samples, in numpy arrays of one shape."""

    sin = staticmethod(np.sin)
    cos = staticmethod(np.cos)
    expm1 = staticmethod(np.expm1)

    @staticmethod
    def sign(x: Array) -> Array:
        """±1 (n,), + at 0."""
        return np.copysign(1.0, x)

    @staticmethod
    def clip(x: Array, low: float, high: float) -> Array:
        """Values (n,) within bounds."""
        return np.clip(x, low, high)

    @staticmethod
    def divide(a: Array, b: Array) -> Array:
        """a / b (n,), infinite where b is 0."""
        with np.errstate(divide="ignore"):
            return np.divide(a, b)

    @staticmethod
    def straight(eta: Array) -> tuple[Triple, Triple]:
        """μ and δ (n,) at y = 0, for η (n,)."""
        step = -np.expm1(-eta)
        small = eta < SMALL
        _, near = backward(0.0, eta, 1.0, step)
        far = forward(_STRAIGHT, 0.0, np.where(small, 1.0, eta), step)
        return _STRAIGHT, _where(small, near, far)

    @staticmethod
    def turning(angle: Array, eta: Array) -> tuple[Triple, Triple]:
        """μ and δ (n,) at y = i·angle, for angles (n,) [rad] and η (n,)."""
        y, end = 1j * angle, np.exp(-1j * angle)
        step = -np.expm1(-eta) * end
        mu_near, delta_near = backward(y, eta, end, step)

        small = angle < SMALL
        half = np.where(small, 1.0, 0.5 * angle)
        m0 = np.exp(-1j * half) * (np.sin(half) / half)
        m1 = (m0 - end) / (2j * half)
        mu = _where(small, mu_near, (m0, m1, (2.0 * m1 - end) / (2j * half)))

        tiny = np.hypot(angle, eta) < SMALL
        far = forward(mu, np.where(tiny, 1.0, y), eta, step)
        return mu, _where(tiny, delta_near, far)


def _where(mask: NDArray[np.bool_], near: Triple, far: Triple) -> Triple:
    return (
        np.where(mask, near[0], far[0]),
        np.where(mask, near[1], far[1]),
        np.where(mask, near[2], far[2]),
    )
