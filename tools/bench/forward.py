"""How fast the forward model is: simulated seconds a second, and the balance against a scalar root
finder.

`python -m gritd.tools.bench.forward` prints it; `gritd bench` shows the same figures.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import copysign, cos, exp, sin
from time import process_time
from typing import NamedTuple

import numpy as np
from scipy import integrate, optimize

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS
from gritd.estimator.model import balance
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.situation import ContactLaw
from gritd.estimator.terramechanics.soil import Soil, Wheel
from gritd.tools.testbed.fingerprints import typical
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import soil_of

RATE = 250.0  # [Hz]
ONE_OF_EACH = (
    "slip_sinkage",
    "rear_contact",
    "bulldozing",
    "bed_slope",
    "coulomb_friction",
    "sinkage_gain",
)
SCALAR_SAMPLES = 20
REPEATS = 5
NODES = list(zip(*(column.tolist() for column in np.polynomial.legendre.leggauss(8)), strict=True))


class BalanceSpeed(NamedTuple):
    """Time of one sample's balance [s], and how far the two solutions are apart."""

    vectorised: float
    scalar: float
    nodes: float  # by brentq on the quadrature of `vectorised`, NODES in each zone
    difference: float  # largest relative difference of θ₁

    @property
    def ratio(self) -> float:
        return self.scalar / self.vectorised


def simulated_seconds_per_second(duration: float = 180.0, effects: tuple[str, ...] = ()) -> float:
    """Simulated over elapsed time of simulate_arrays on the packaged testbed, best of REPEATS."""
    settings = config.load(packaged()).settings
    levels = [(load, slip) for load in (40.0, 70.0, 100.0) for slip in (0.1, 0.2, 0.35, 0.6)]
    segments = tuple(Segment(duration / len(levels), load, slip, 0.02) for load, slip in levels)
    motion = motion_of(Schedule(segments, 0.5), settings.wheel.radius, RATE)
    acting = [typical(EFFECTS[name]) for name in effects]
    soil = soil_of(settings)
    return duration / _best(lambda: simulate_arrays(settings.wheel, soil, motion, acting))


def balance_speed(samples: int = 8192, seed: int = 0) -> BalanceSpeed:
    """The vectorised balance against scipy's brentq on scipy's quad, to the same tolerance, on
    drawn samples.
    """
    settings = config.load(packaged()).settings
    wheel, soil = settings.wheel, soil_of(settings)
    rng = np.random.default_rng(seed)
    slip, load = rng.uniform(0.0, 0.8, samples), rng.uniform(30.0, 105.0, samples)
    contact = balance.Contact(soil, ContactLaw(0.5), slip, load)
    theta_1 = balance.solve(wheel, contact).theta_1
    vectorised = _best(lambda: balance.solve(wheel, contact)) / samples

    start = process_time()
    expected = np.array([_scalar(wheel, soil, slip[i], load[i]) for i in range(SCALAR_SAMPLES)])
    scalar = (process_time() - start) / SCALAR_SAMPLES

    start = process_time()
    for i in range(SCALAR_SAMPLES):
        _scalar(wheel, soil, slip[i], load[i], _by_nodes)
    nodes = (process_time() - start) / SCALAR_SAMPLES

    difference = float(np.max(np.abs(theta_1[:SCALAR_SAMPLES] / expected - 1.0)))
    return BalanceSpeed(vectorised, scalar, nodes, difference)


def _best(run: Callable[[], object]) -> float:
    """Shortest of REPEATS runs [s]: what the machine can do when nobody else has it."""
    times = []
    for _ in range(REPEATS):
        start = process_time()
        run()
        times.append(process_time() - start)
    return min(times)


def _adaptive(low: float, high: float, given: tuple[Wheel, Soil, float, float]) -> float:
    """The integral of `_vertical` over a zone, by quad."""
    tolerance = balance.TOLERANCE
    return float(integrate.quad(_vertical, low, high, given, epsabs=0.0, epsrel=tolerance)[0])


def _by_nodes(low: float, high: float, given: tuple[Wheel, Soil, float, float]) -> float:
    """The same by Gauss-Legendre on NODES nodes, in plain floats."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return float(half * sum(w * _vertical(middle + half * u, *given) for u, w in NODES))


def _scalar(
    wheel: Wheel,
    soil: Soil,
    slip: float,
    load: float,
    integral: Callable[[float, float, tuple[Wheel, Soil, float, float]], float] = _adaptive,
) -> float:
    """θ₁ [rad] by brentq on the integral (9), relative tolerance as in
    estimator/model/balance.py.
    """

    def miss(theta_1: float) -> float:
        theta_m = 0.5 * theta_1
        zones = ((0.0, theta_m), (theta_m, theta_1))
        carried = sum(integral(*zone, (wheel, soil, slip, theta_1)) for zone in zones)
        return float(wheel.radius * wheel.width * carried - load)

    return float(optimize.brentq(miss, 0.05, balance.DEEPEST, xtol=1e-12, rtol=balance.TOLERANCE))


def _vertical(theta: float, wheel: Wheel, soil: Soil, slip: float, theta_1: float) -> float:
    """Integrand of (9), τ sin θ + σ cos θ, from (3), (4), (6), (7) in plain floats; driving, θₘ =
    θ₁/2.
    """
    front = theta if theta >= 0.5 * theta_1 else theta_1 - theta
    drop = max(cos(front) - cos(theta_1), 0.0)
    sigma = float(soil.modulus) * (wheel.radius * drop) ** float(soil.exponent)
    j = wheel.radius * (theta_1 - theta - (1.0 - slip) * (sin(theta_1) - sin(theta)))
    mobilised = copysign(1.0 - exp(-abs(j) / float(soil.shear_modulus)), j)
    tau = (float(soil.cohesion) + sigma * float(soil.tan_phi)) * mobilised
    return float(tau * sin(theta) + sigma * cos(theta))


def main() -> int:
    """Print the figures."""
    plain, six = simulated_seconds_per_second(), simulated_seconds_per_second(effects=ONE_OF_EACH)
    speed = balance_speed()

    print(
        f"simulator at {RATE:g} Hz: {plain:.0f} simulated seconds a second; "
        f"with six effects {six:.0f}"
    )
    print(
        f"balance: {1e6 * speed.vectorised:.2f} µs a sample; brentq on quad: "
        f"{1e3 * speed.scalar:.2f} ms"
    )
    print(f"ratio {speed.ratio:.0f}, largest relative difference of θ₁ {speed.difference:.1e}")

    return 0


if __name__ == "__main__":
    sys.exit(main())
