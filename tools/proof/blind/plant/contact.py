"""Stresses under the rim, Eqs. (1)-(10), integrated by tanh-sinh; arrays (n,), one value a sample.

Equation numbers are those of Shibly, Iagnemma, Dubowsky (2005), J. Terramechanics 42, 1-13. Angles
θ [rad] count from bottom dead centre, positive forward. Everything here is for forward travel;
`respond` mirrors it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gritd.tools.proof.blind.plant.quadrature import RULE, Array


@dataclass(frozen=True)
class Ground:
    """Soil under the wheel, sample by sample: floats or arrays (n,)."""

    cohesion: Array | float  # c [Pa]
    tan_phi: Array | float
    shear_modulus: Array | float  # k [m]
    exponent: Array | float  # n
    modulus: Array | float  # K of σ = K zⁿ [Pa/mⁿ]


@dataclass(frozen=True)
class Rim:
    """How the rim loads the soil: floats or arrays (n,)."""

    peak: Array | float = 0.5  # θₘ/θ₁, Eq. (5)
    rebound: Array | float = 0.0  # share of the sinkage that springs back behind the wheel
    strength: Array | float = 1.0  # factor on the shear strength
    overshoot: Array | float = 0.0  # hump of the shear curve over its residual


Sampled = TypeVar("Sampled", Ground, Rim)


def thinned(what: Sampled, every: int) -> Sampled:
    """Only each `every`-th sample of what varies."""
    kept: dict[str, Any] = {f.name: _thin(getattr(what, f.name), every) for f in fields(what)}
    return replace(what, **kept)


def _thin(value: Array | float, every: int) -> Array | float:
    return value[::every] if isinstance(value, np.ndarray) and value.ndim else value


class Reaction(NamedTuple):
    """What the soil does to the wheel, arrays (n,)."""

    pull: Array  # DP [N], Eq. (8)
    load: Array  # W [N], Eq. (9)
    torque: Array  # T [N·m], Eq. (10)
    pressure: Array  # mean normal stress on the rim in contact [Pa]


class Zone(NamedTuple):
    """Nodes of one zone, arrays (n, m): θ₁ − θ, its shadow in the front zone for Eq. (4), weights
    dθ.
    """

    turned: Array
    shadow: Array
    width: Array


def reaction(
    ground: Ground, rim: Rim, radius: float, width: float, ratio: Array, theta_1: Array
) -> Reaction:
    """Forces at entry angle θ₁ (n,) and v/(rω) `ratio` (n,)."""
    theta_1 = np.maximum(theta_1, 1e-6)
    front, rear = _zones(rim, theta_1)
    parts = [_zone(ground, rim, radius, ratio, theta_1, zone) for zone in (front, rear)]
    along, down, turning, pressing = (a + b for a, b in zip(*parts, strict=True))
    arc = theta_1 + exit_angle(rim, theta_1)
    area = radius * width
    return Reaction(area * along, area * down, radius * area * turning, pressing / arc)


def exit_angle(rim: Rim, theta_1: Array) -> Array:
    """−θ₂: where soil that springs back by a share of the sinkage leaves the rim (Ishigami et al.
    2007).
    """
    share = np.clip(rim.rebound, 0.0, 1.0)
    return np.asarray(2.0 * np.arcsin(np.sqrt(share) * np.sin(0.5 * theta_1)))


def _zones(rim: Rim, theta_1: Array) -> tuple[Zone, Zone]:
    theta_m = np.clip(rim.peak, 0.02, 0.98) * theta_1
    ahead, behind = (theta_1 - theta_m)[:, None], (theta_m + exit_angle(rim, theta_1))[:, None]
    turned = ahead * RULE.from_start
    front = Zone(turned, turned, ahead * RULE.weight)
    rear = Zone(ahead + behind * RULE.from_start, ahead * RULE.to_end, behind * RULE.weight)
    return front, rear


def _zone(
    ground: Ground, rim: Rim, radius: float, ratio: Array, theta_1: Array, zone: Zone
) -> tuple[Array, Array, Array, Array]:
    """∫(τ cos − σ sin), ∫(σ cos + τ sin), ∫τ, ∫σ over one zone."""
    entry = theta_1[:, None]
    theta = entry - zone.turned
    sigma = _normal(ground, radius, entry, zone.shadow)
    jay = radius * (zone.turned - column(ratio) * _sine_gap(entry, zone.turned))  # Eq. (6)
    tau = (column(ground.cohesion) + sigma * column(ground.tan_phi)) * column(rim.strength)
    tau = tau * mobilised(jay / column(ground.shear_modulus), column(rim.overshoot))  # Eq. (7)
    cosine, sine, weight = np.cos(theta), np.sin(theta), zone.width
    return (
        ((tau * cosine - sigma * sine) * weight).sum(axis=1),
        ((sigma * cosine + tau * sine) * weight).sum(axis=1),
        (tau * weight).sum(axis=1),
        (sigma * weight).sum(axis=1),
    )


def _normal(ground: Ground, radius: float, entry: Array, shadow: Array) -> Array:
    """σ = K rⁿ (cos θ − cos θ₁)ⁿ, Eqs. (3), (4), the cosines' difference as a product of sines."""
    drop = 2.0 * np.sin(entry - 0.5 * shadow) * np.sin(0.5 * shadow)
    stress: Array = column(ground.modulus) * np.exp(
        column(ground.exponent) * np.log(radius * np.maximum(drop, 1e-30))
    )
    return stress


def _sine_gap(entry: Array, turned: Array) -> Array:
    gap: Array = 2.0 * np.cos(entry - 0.5 * turned) * np.sin(0.5 * turned)
    return gap


def mobilised(x: Array, overshoot: Array | float) -> Array:
    """Share of the residual strength mobilised at x = j/k: Eq. (2) and a hump P x e^(1 − x) that
    dies out.

    The hump is of the kind of Oida (1979), J. Terramechanics 16: exponential rise and decay to a
    residual.
    """
    far = np.abs(x)
    fading = np.exp(-far)
    share: Array = np.sign(x) * (1.0 - fading + overshoot * np.e * far * fading)
    return share


def column(value: Array | float) -> Array:
    """Samples down, nodes across."""
    return np.asarray(value, dtype=float).reshape(-1, 1)
