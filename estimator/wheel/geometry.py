"""Slip, entry angle and angle of maximum stress, each with its variance. Plain floats in, plain
floats out.

Slip is positive when the wheel turns faster than it travels (driving) and negative when it is
pushed (braking):

    i = (rω − v) / rω     rω ≥ v        i = (rω − v) / v     rω < v

so −1 ≤ i ≤ 1 for forward travel and i is continuous through zero with slope one in (rω − v)/rω.
"""

from __future__ import annotations

from math import acos, hypot, isnan, nan, sin, sqrt
from typing import NamedTuple

# [m/s] a slower wheel has no slip to speak of, and its square is no number any more
AT_REST = 1e-12
SMALLEST_SINE = 1e-6  # below this θ₁ a sinkage error is not a small error of angle


class Slip(NamedTuple):
    value: float  # i [-]
    d_rim: float  # ∂i/∂(rω) [s/m]
    d_travel: float  # ∂i/∂v [s/m]


def slip(rim_speed: float, travel_speed: float) -> Slip:
    """Slip i from the rim speed rω and the travel speed v, both [m/s] along the direction of
    travel; 0 at rest.

    NaN of NaN. Defined for rω ≥ 0 or v ≥ 0; opposed motions saturate at ±1 with zero derivatives.
    """
    if isnan(rim_speed) or isnan(travel_speed):
        return Slip(nan, nan, nan)
    if abs(rim_speed) < AT_REST and abs(travel_speed) < AT_REST:
        return Slip(0.0, 0.0, 0.0)

    if rim_speed >= travel_speed:
        if travel_speed < 0.0:
            return Slip(1.0, 0.0, 0.0)
        return Slip(1.0 - travel_speed / rim_speed, travel_speed / rim_speed**2, -1.0 / rim_speed)

    if rim_speed < 0.0:
        return Slip(-1.0, 0.0, 0.0)
    return Slip(rim_speed / travel_speed - 1.0, 1.0 / travel_speed, -rim_speed / travel_speed**2)


def slip_sigma(estimate: Slip, rim_sigma: float, travel_sigma: float) -> float:
    """Standard deviation of i from those of rω and v [m/s], independent."""
    return hypot(estimate.d_rim * rim_sigma, estimate.d_travel * travel_sigma)


class EntryAngle(NamedTuple):
    value: float  # θ₁ [rad]
    d_sinkage: float  # ∂θ₁/∂z [rad/m]


def entry_angle(radius: float, sinkage: float) -> EntryAngle:
    """θ₁ = arccos(1 − z/r); 0 for a wheel at or above the surface, at most π/2 (sinkage r)."""
    ratio = 1.0 - sinkage / radius
    if ratio >= 1.0:
        return EntryAngle(0.0, 0.0)
    theta_1 = acos(max(ratio, 0.0)) if ratio < 1.0 else 0.0
    return EntryAngle(theta_1, 1.0 / (radius * max(sin(theta_1), SMALLEST_SINE)))


def sinkage(radius: float, theta_1: float) -> float:
    """z = r(1 − cos θ₁) [m]; written with the half angle so that small θ₁ keeps its digits."""
    return 2.0 * radius * sin(0.5 * theta_1) ** 2


def max_stress_angle(c1: float, c2: float, slip_value: float, theta_1: float) -> float:
    """θₘ = (c₁ + c₂ i) θ₁, Eq. (5), kept inside the contact [0, θ₁]."""
    return min(max(c1 + c2 * slip_value, 0.0), 1.0) * theta_1


def slope_sigma(scatter: float, spread: float, readings: int, counts_moved: float) -> float:
    """Standard deviation of a speed fitted by least squares to quantised counts.

    scatter:      standard deviation of one reading, quantisation included [raw]
    spread:       √Σ(t − t̄)² of the readings' stamps [s]
    readings:     number of readings n in the window
    counts_moved: counts moved within the window m [raw]

    Quantisation errors are independent only while the count changes between readings. A count that
    moves by m edges in the window is worth about (m + 1)² independent readings, never more than n:
    a bound found by simulation (the test repeats it); with no edge at all it is one count over the
    window.
    """
    independent = min(readings, (int(counts_moved) + 1) ** 2)

    return scatter / spread * sqrt(readings / independent)
