"""The original model, Eqs. (1)-(10): stresses on the rim, integrated by Gauss-Legendre quadrature.

Angles θ [rad] are measured from bottom dead centre, positive forward: entry θ₁, peak of normal
stress θₘ, exit θ₂.
Samples run along the last axis: every argument is a float or an array (n,), and the results have
that shape. Angles inside the contact carry the quadrature nodes on the axis before it. Valid for 0
≤ θ₁ ≤ π/2, −1 < i ≤ 1.

The pieces can be called apart: `contact` gives σ and τ at the nodes, `integrate` sums whatever
stands there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from gritd.estimator.terramechanics.soil import Array, Scalar, Soil, Wheel

Mobilisation = Callable[[Array], Array]  # share of the shear strength mobilised at j/k; odd in j/k

ORDER = 16  # nodes in each of the two zones; docs/physics.md states the error
UNMOVED = 1e-300  # [m] displacement of soil that has no direction
LOCKED = 1e-9  # smallest 1 + i: a locked wheel has travelled 1e9 times what its rim has turned


class Arc(NamedTuple):
    """Points θ on the rim, seen from the entry angle θ₁."""

    turned: Array  # θ₁ − θ [rad]
    sine: Array  # sin θ
    cosine: Array  # cos θ
    drop: Array  # cos θ − cos θ₁, depth below the surface over r
    advance: Array  # sin θ₁ − sin θ


class ContactStresses(NamedTuple):
    """Stresses at the nodes, rear zone first; each field (2·order, n), or (2·order,) for one
    sample.
    """

    points: Arc
    weight: Array  # quadrature weight times dθ [rad]
    sigma: Array  # normal stress [Pa]
    tau: Array  # shear stress, positive where it drives the wheel forward [Pa]
    across: Array  # shear stress across the wheel, against its sliding sideways [Pa]


class OriginalForces(NamedTuple):
    """What the soil does to the wheel; each field (n,), or 0-d for one sample."""

    drawbar_pull: Array  # DP [N], Eq. (8)
    load: Array  # W [N], Eq. (9)
    torque: Array  # T [N·m], Eq. (10)
    resistance: Array  # second term of (8), rb∫σ sin θ dθ [N]
    side_force: Array  # rb∫τ_y dθ [N], 0 for a wheel that goes where it points


def theta_m(wheel: Wheel, slip: Scalar, theta_1: Scalar) -> Scalar:
    """Angle of maximum stress (n,) [rad], kept inside [0, θ₁]. Eq. (5)."""
    return np.clip(wheel.c1 + wheel.c2 * slip, 0.0, 1.0) * theta_1


def velocity_ratio(slip: Scalar) -> Array:
    """Carriage speed over rim speed (n,), v/(rω): 1 − i when driving, 1/(1 + i) when braking.

    Slip is i = 1 − v/(rω) for i ≥ 0 and i = rω/v − 1 for i < 0. Both branches meet at i = 0 with
    the same slope.
    """
    # 1 when driving, 1 + i when braking
    q = np.clip(1.0 + np.asarray(slip, dtype=float), LOCKED, 1.0)
    return np.asarray(1.0 - slip / q)


def arc(theta_1: Scalar, theta: Scalar) -> Arc:
    """Angles of points θ (2·order, n) on the rim, θ₁ (n,) [rad]; differences of sines and cosines
    keep their digits however small the angles.
    """
    turned = np.subtract(theta_1, theta)
    u = np.tan(0.5 * turned)  # one tangent instead of sine and cosine: numpy vectorises it
    q = 2.0 * u / (1.0 + u * u)  # sin(θ₁ − θ)
    sin_1, cos_1 = np.sin(theta_1), np.cos(theta_1)
    drop, advance = q * (sin_1 - cos_1 * u), q * (cos_1 + sin_1 * u)
    return Arc(turned, sin_1 - advance, cos_1 + drop, drop, advance)


def front_stress(wheel: Wheel, soil: Soil, front: Arc) -> Array:
    """Normal stress σ (2·order, n) [Pa] between θₘ and θ₁, Eq. (3): K rⁿ (cos θ − cos θ₁)ⁿ; zero
    ahead of θ₁.
    """
    stress: Array = soil.modulus * (wheel.radius * np.maximum(front.drop, 0.0)) ** soil.exponent
    return stress


def shear_displacement(wheel: Wheel, slip: Scalar, points: Arc) -> Array:
    """Shear displacement j (2·order, n) [m] of the soil, Eq. (6): r[θ₁ − θ − (1 − i)(sin θ₁ −
    sin θ)].

    The rim moves past the soil at rω − v cos θ while θ falls from θ₁ at the rate ω, so j = r∫(1 −
    (v/rω) cos θ) dθ. Written with v/(rω) it holds for driving and braking; j < 0 where the soil has
    been dragged forward.
    """
    displacement: Array = wheel.radius * (points.turned - velocity_ratio(slip) * points.advance)
    return displacement


def lateral_displacement(wheel: Wheel, slip: Scalar, points: Arc, side_slip: Scalar) -> Array:
    """Displacement (2·order, n) of the soil across the wheel [m]: r (v/rω)(θ₁ − θ) tan β.

    side_slip is tan β, β the angle between wheel and travel: Ishigami et al. (2007), J. Field
    Robotics 24, 233-250.
    """
    displacement: Array = wheel.radius * velocity_ratio(slip) * side_slip * points.turned
    return displacement


def janosi(x: Array) -> Array:
    """Share of the shear strength mobilised at x = j/k (2·order, n), Eq. (2): 1 − e^(−x); odd, so
    that τ has the sign of j.

    Janosi and Hanamoto (1961).
    """
    return np.copysign(np.expm1(-np.abs(x)), x)


def shear_stress(
    soil: Soil, sigma: Array, displacement: Array, mobilisation: Mobilisation = janosi
) -> Array:
    """Shear stress τ (2·order, n) [Pa], Eqs. (2) and (7): (c + σ tan φ)(1 − e^(−j/k))."""
    stress: Array = (soil.cohesion + sigma * soil.tan_phi) * mobilisation(
        displacement / soil.shear_modulus
    )
    return stress


def contact(
    wheel: Wheel,
    soil: Soil,
    theta_1: Scalar,
    slip: Scalar,
    *,
    theta_m: Scalar | None = None,
    theta_2: Scalar = 0.0,
    mobilisation: Mobilisation = janosi,
    side_slip: Scalar = 0.0,
    by_sliding: float = 0.0,
    across: float = 1.0,
    order: int = ORDER,
) -> ContactStresses:
    """Stresses of Eqs. (3), (4) and (7) at the quadrature nodes of the rear and front zones. θₘ
    follows (5) unless given; θ₂ is 0 as in the paper.

    Under a wheel that slides sideways the shear stress has the direction of the displacement j of
    the soil; by_sliding: share in which it has that of the sliding of the rim instead; across: the
    shear modulus along the wheel over that across it.
    """
    peak = _peak(wheel, slip, theta_1) if theta_m is None else theta_m
    shape = np.broadcast_shapes(*(np.shape(value) for value in (theta_1, slip, peak, theta_2)))
    s, ds = (values.reshape(-1, *(1 for _ in shape)) for values in nodes(order))
    front, rear = theta_1 - s * (theta_1 - peak), theta_2 + s * (peak - theta_2)
    points = arc(theta_1, np.concatenate(np.broadcast_arrays(rear, front)))
    weight = np.concatenate(np.broadcast_arrays(ds * (peak - theta_2), ds * (theta_1 - peak)))
    sigma = front_stress(wheel, soil, Arc(*(field[order:] for field in points)))
    sigma = np.concatenate((sigma, sigma))  # by Eq. (4) the rear zone's is the same at the same s

    displacement = shear_displacement(wheel, slip, points)
    if not np.any(side_slip):
        tau = shear_stress(soil, sigma, displacement, mobilisation)
        return ContactStresses(points, weight, sigma, tau, np.zeros_like(tau))

    lateral = across * lateral_displacement(wheel, slip, points, side_slip)
    tau = shear_stress(soil, sigma, np.hypot(displacement, lateral), mobilisation)
    x, y = _direction(displacement, lateral)
    if by_sliding:
        ratio = velocity_ratio(slip)
        s_x, s_y = _direction(1.0 - ratio * points.cosine, ratio * side_slip)
        x, y = x + by_sliding * (s_x - x), y + by_sliding * (s_y - y)
    return ContactStresses(points, weight, sigma, tau * x, tau * y)


def _direction(x: Array, y: Array) -> tuple[Array, Array]:
    """Cosine and sine of the angle of (x, y) to the wheel's plane."""
    length = np.maximum(np.hypot(x, y), UNMOVED)
    return x / length, y / length


def integrate(wheel: Wheel, contact: ContactStresses) -> OriginalForces:
    """Forces on the wheel from the stresses on its rim, Eqs. (8)-(10)."""
    points = contact.points
    area = wheel.radius * wheel.width * contact.weight  # r b dθ
    sigma, tau = area * contact.sigma, area * contact.tau
    resistance = _dot(sigma, points.sine)
    drawbar_pull = _dot(tau, points.cosine) - resistance  # Eq. (8)
    load = _dot(tau, points.sine) + _dot(sigma, points.cosine)  # Eq. (9)
    torque = wheel.radius * np.sum(tau, axis=0)  # Eq. (10)
    slides = np.any(contact.across)
    side_force = np.sum(area * contact.across, axis=0) if slides else np.zeros_like(torque)
    return OriginalForces(drawbar_pull, load, torque, resistance, side_force)


def forces(
    wheel: Wheel, soil: Soil, theta_1: Scalar, slip: Scalar, **contacting: Any
) -> OriginalForces:
    """DP, W, T and resistance of Eqs. (8)-(10); contacting: what `contact` may be given besides."""
    return integrate(wheel, contact(wheel, soil, theta_1, slip, **contacting))


_peak = theta_m  # `contact` has an argument of that name


def _dot(a: Array, b: Array) -> Array:
    """Sum of products over the nodes."""
    total: Array = np.einsum("i...,i...->...", a, b)
    return total


@cache
def nodes(order: int) -> Array:
    """Nodes and weights (2, order) on s ∈ [0, 1], where s = 0 is the stress-free end of a zone and
    s = 1 is θₘ.

    Gauss-Legendre in t with s = t³: stress starts as sⁿ, which is t³ⁿ and so smooth enough for any
    n of a soil.
    """
    t, weight = np.polynomial.legendre.leggauss(order)
    t = 0.5 * (t + 1.0)
    return np.stack((t**3, 1.5 * weight * t**2))
