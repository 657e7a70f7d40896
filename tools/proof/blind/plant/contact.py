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

TINY = 1e-12  # a rim that does not slide is held along its plane
LIGHT = 5e3  # σ₀ [Pa] pressure below which a smooth rim grips like a rough one


@dataclass(frozen=True)
class PlantSoil:
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
    overshoot: Array | float = 0.0  # hump of the shear curve over its residual, after Oida
    brittle: Array | float = 0.0  # the same, after Kacigin and Guskov
    polish: Array | float = 0.0  # by how much friction on the rim is below that within the soil
    sliding: Array | float = 0.0  # by how much the rim slides before the soil's strength is reached
    skew: Array | float = 0.0  # tangent of the angle from the wheel's plane to its travel

    @property
    def along(self) -> Array | float:
        """The share of the travel that is along the wheel's plane: the cosine of that angle."""
        return 1.0 / np.hypot(1.0, self.skew)


Sampled = TypeVar("Sampled", PlantSoil, Rim)


def thinned(what: Sampled, every: int) -> Sampled:
    """Only each `every`-th sample of what varies."""
    kept: dict[str, Any] = {f.name: _thin(getattr(what, f.name), every) for f in fields(what)}
    return replace(what, **kept)


def _thin(value: Array | float, every: int) -> Array | float:
    return value[::every] if isinstance(value, np.ndarray) and value.ndim else value


def columned(what: Sampled) -> Sampled:
    """Samples down, (n, 1) or (1, 1), so that nodes go across."""
    held: dict[str, Any] = {f.name: column(getattr(what, f.name)) for f in fields(what)}
    return replace(what, **held)


class SoilReaction(NamedTuple):
    """What the soil does to the wheel, arrays (n,)."""

    pull: Array  # DP [N], Eq. (8)
    load: Array  # W [N], Eq. (9)
    torque: Array  # T [N·m], Eq. (10)
    pressure: Array  # mean normal stress on the rim in contact [Pa]
    side: Array  # sideways force of a skewed wheel [N]


class Sliding(NamedTuple):
    """How the rim slides on the soil; in any unit."""

    along: Array
    aside: Array


class Zone(NamedTuple):
    """Nodes of one zone, arrays (n, m)."""

    turned: Array  # θ₁ − θ [rad]
    cosine: Array  # of θ
    sine: Array
    gap: Array  # sin θ₁ − sin θ, for Eq. (6)
    drop: Array  # cos θ − cos θ₁ at the angle in the front zone where σ is the same, Eq. (4)
    width: Array  # weights dθ


def reaction(
    ground: PlantSoil, rim: Rim, radius: float, width: float, ratio: Array, theta_1: Array
) -> SoilReaction:
    """Forces at entry angle θ₁ (n,) and v/(rω) `ratio` (n,)."""
    theta_1 = np.maximum(theta_1, 1e-6)
    zones = _zones(rim, theta_1)
    ground, held = columned(ground), columned(rim)
    parts = [_zone(ground, held, radius, ratio * rim.along, zone) for zone in zones]
    along, down, turning, pressing, across = (a + b for a, b in zip(*parts, strict=True))

    arc = theta_1 + exit_angle(rim, theta_1)
    area = radius * width
    return SoilReaction(
        area * along, area * down, radius * area * turning, pressing / arc, area * across
    )


def exit_angle(rim: Rim, theta_1: Array) -> Array:
    """−θ₂ (n,) [rad], at entry angles (n,) [rad]: where soil that springs back by a share of the
    sinkage leaves the rim (Ishigami et al. 2007).
    """
    share = np.clip(rim.rebound, 0.0, 1.0)
    return np.asarray(2.0 * np.arcsin(np.sqrt(share) * np.sin(0.5 * theta_1)))


def _zones(rim: Rim, theta_1: Array) -> tuple[Zone, Zone]:
    theta_m = np.clip(rim.peak, 0.02, 0.98) * theta_1
    ahead, behind = (theta_1 - theta_m)[:, None], (theta_m + exit_angle(rim, theta_1))[:, None]
    entry = theta_1[:, None]
    forward = ahead * RULE.from_start
    backward = ahead + behind * RULE.from_start
    front = _nodes(entry, forward, None, ahead * RULE.weight)
    rear = _nodes(entry, backward, ahead * RULE.to_end, behind * RULE.weight)
    return front, rear


def _nodes(entry: Array, turned: Array, shadow: Array | None, width: Array) -> Zone:
    """A zone from its nodes θ₁ − θ; `shadow`: the same for the drop, where it differs.

    Differences of sines and cosines are products of half angles: no digits are lost at the entry.
    """
    sine, cosine, half = np.sin(entry), np.cos(entry), 0.5 * turned
    up, along = np.sin(half), np.cos(half)
    gap = 2.0 * up * (sine * up + cosine * along)
    drop = 2.0 * up * (sine * along - cosine * up)

    if shadow is not None:
        dip = np.sin(0.5 * shadow)
        mirrored = 2.0 * dip * (sine * np.cos(0.5 * shadow) - cosine * dip)
    else:
        mirrored = drop

    return Zone(turned, cosine + drop, sine - gap, gap, mirrored, width)


def _zone(
    ground: PlantSoil, rim: Rim, radius: float, ratio: Array, zone: Zone
) -> tuple[Array, Array, Array, Array, Array]:
    """∫(τ cos − σ sin), ∫(σ cos + τ sin), ∫τ, ∫σ, ∫τ across, over one zone."""
    sigma = _normal(ground, radius, zone.drop)
    jay = radius * (zone.turned - column(ratio) * zone.gap)  # Eq. (6)

    sliding = None
    if np.any(rim.skew):
        along = 1.0 - column(ratio) * zone.cosine
        sliding = Sliding(along, column(ratio) * np.asarray(rim.skew) + 0.0 * along)
    tau, across = sheared(ground, rim, sigma, jay, sliding)

    cosine, sine, weight = zone.cosine, zone.sine, zone.width
    return (
        ((tau * cosine - sigma * sine) * weight).sum(axis=1),
        ((sigma * cosine + tau * sine) * weight).sum(axis=1),
        (tau * weight).sum(axis=1),
        (sigma * weight).sum(axis=1),
        (across * weight).sum(axis=1),
    )


def _normal(ground: PlantSoil, radius: float, drop: Array) -> Array:
    """σ = K rⁿ (cos θ − cos θ₁)ⁿ, Eqs. (3), (4)."""
    depth = radius * np.maximum(drop, 1e-30)
    stress: Array = ground.modulus * np.exp(ground.exponent * np.log(depth))
    return stress


def sheared(
    ground: PlantSoil, rim: Rim, sigma: Array, jay: Array, sliding: Sliding | None = None
) -> tuple[Array, Array]:
    """Shear stress τ along and across the wheel's plane under normal stress σ and displacement j,
    Eqs. (2), (7). All broadcast to (n, nodes).

    The stress of a skewed wheel has the direction in which the rim slides (Coulomb). A smooth rim
    grips 1 − s σ/(σ + σ₀) of the soil's strength: the envelope of sand on steel is bent, and
    its slope falls to about half, Uesugi and Kishida (1986), Soils and Foundations 26(4), 139-149.
    """
    gripped = 1.0 - rim.polish * sigma / (sigma + LIGHT)
    strength = (ground.cohesion + sigma * ground.tan_phi) * rim.strength * gripped
    tau = strength * mobilised(jay / ground.shear_modulus, rim)

    if sliding is None:
        return tau, np.zeros((1, 1))
    speed = np.hypot(*sliding) + TINY
    return tau * (np.abs(sliding.along) + TINY) / speed, np.abs(tau) * sliding.aside / speed


def mobilised(x: Array, rim: Rim) -> Array:
    """Share of the residual strength mobilised at x = j/k (n, nodes): Eq. (2), and humps that die
    out.

    P x e^(1 − x) is of the kind of Oida (1979), J. Terramechanics 16: exponential rise and decay
    to a residual. 2 Q tanh y/cosh y, y = 2x, is that of Kacigin and Guskov (1968), J.
    Terramechanics 5(3), of a crust that breaks early.
    A rim that slides gives way beside the soil, by a hyperbola that ends at 1 − s of the strength:
    Clough and Duncan (1971), J. Soil Mech. Found. Div. 97, 1657-1673.
    """
    far = np.abs(x)
    fading = np.exp(-far)
    share = 1.0 - fading + rim.overshoot * np.e * far * fading

    if np.any(rim.brittle):
        share = share + 4.0 * rim.brittle * np.tanh(2.0 * far) * fading**2 / (1.0 + fading**4)
    if np.any(rim.sliding):
        share = share * (1.0 - rim.sliding) / (1.0 - rim.sliding + rim.sliding * share)

    signed: Array = np.sign(x) * share
    return signed


def column(value: Array | float) -> Array:
    """Values (n,) of samples as a column (n, 1), nodes across."""
    return np.asarray(value, dtype=float).reshape(-1, 1)
