"""What every model of a wheel in soil misses: a smooth function δ of the conditions, learnt.

The measured quantity of a channel is f(motion; soil, calibration, effects) + δ(conditions) + noise
(Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425-464). δ is a Gaussian process over
dimensionless conditions. Its covariance function is a constant, plus a squared exponential in each
condition, plus one in all of them together:

    k(x, x′) = 0.3 + 0.35 mean_d exp(−(x_d − x′_d)²/2) + 0.35 exp(−|x − x′|²/2)

so that most of δ is a level, some of it bends along single conditions, and the rest is free. Its
rank is reduced by inducing points, chosen one after the other where the variance that is left is
largest (pivoted Cholesky: Fine and Scheinberg 2001, J. Mach. Learn. Res. 2, 243-264). With points
X and the root L of k(X, X), the features φ(x) = k(x, X) L⁻ᵀ have unit normal weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array

LEVEL, ALONG, TOGETHER = 0.3, 0.35, 0.35  # shares of the variance of δ

# Lengths over which δ changes by its own size, of each condition. A judgement: a misfit of drawbar
# pull or torque changes over a quarter of the range of slip, and over a factor of 1.6 of load.
SLIP = 0.25  # slip [-]
LOAD = 0.5  # ln(W / usual W)
SPEED = 1.0  # ln(rω / usual rω)
DIRECTION = 0.7  # forward 1, backward −1
LAG = 0.15  # slip less the slip a while ago [-]
LOAD_LAG = 0.3  # ln W less ln W a while ago
# [m] of rim over which "a while ago" is forgotten: a rim's compliance, a contact, a rut dug anew
TRAVELS = (0.003, 0.01, 0.03, 0.1)
LOAD_TRAVEL = 0.03  # [m] the same for the load
START = 0.5  # what is left of a start: 1 where a run begins, forgotten over START_TRAVEL
START_TRAVEL = 0.05  # [m] of rim: soil under a wheel that was set down is not yet sheared or pushed

CARRYING = 0.2  # of the usual load: below it the wheel hardly touches soil, and δ is zero

CONDITIONS = (
    "slip",
    "load",
    "speed",
    "direction",
    "short_lag",
    "lag",
    "long_lag",
    "longest_lag",
    "load_lag",
    "start",
)


def covariance(x: Array, y: Array) -> Array:
    """k (n, m) between conditions (n, d) and (m, d), in units of the lengths above."""
    apart = (x[:, None, :] - y[None, :, :]) ** 2
    single = np.exp(-0.5 * apart).mean(axis=2)
    return np.asarray(LEVEL + ALONG * single + TOGETHER * np.exp(-0.5 * apart.sum(axis=2)))


@dataclass(frozen=True, eq=False)
class Features:
    """The reduced rank of δ: inducing points (m, d) and the root (m, m) of their covariance."""

    points: Array
    root: Array

    def at(self, conditions: Array) -> Array:
        """φ (n, m) at conditions (n, d)."""
        between = covariance(conditions, self.points)
        return np.asarray(np.linalg.solve(self.root, between.T).T)


def features_of(conditions: Array, most: int, least: float) -> Features:
    """Inducing points among conditions (n, d): at most so many, until no variance above `least` is
    left.
    """
    left = np.ones(len(conditions))
    columns = np.zeros((len(conditions), most))
    chosen: list[int] = []
    while len(chosen) < most:
        place = int(np.argmax(left))
        if left[place] < least:
            break

        known = len(chosen)
        column = covariance(conditions, conditions[place : place + 1])[:, 0]
        column = (column - columns[:, :known] @ columns[place, :known]) / np.sqrt(left[place])
        columns[:, known] = column
        left = np.maximum(left - column**2, 0.0)
        chosen.append(place)

    size = len(chosen)
    return Features(conditions[chosen], columns[chosen, :size])


def trailing(values: Array, travel: Array, length: float) -> Array:
    """What values (n,) were a while ago: a low-pass along the travel of the rim (n,) [m]."""
    out = np.empty_like(values, dtype=float)
    out[0] = values[0]
    kept = np.exp(-np.abs(np.diff(travel, prepend=travel[0])) / length)
    for place in range(1, values.size):
        out[place] = kept[place] * out[place - 1] + (1.0 - kept[place]) * values[place]
    return out


@dataclass(frozen=True)
class Usual:
    """What loads and speeds count from: geometric means."""

    load: float  # [N]
    rim_speed: float  # [m/s]


def weight_of(
    load: Array,
    speed: Array,
    direction: Array,
    usual: Usual,
    signed: bool,
    carrying: float = CARRYING,
) -> Array:
    """How large δ is (n,): in proportion to the load, 0 where no soil is touched.

    load [N], speed of the rim [m/s], direction −1 … 1: each (n,); signed: whether the channel turns
    with the direction; carrying: share of the usual load below which no soil is touched.
    """
    share = load / usual.load
    touching = (speed > 0.0) & (share > carrying)

    return np.asarray(np.where(touching, share * (direction if signed else np.abs(direction)), 0.0))


def conditions_of(
    slip: Array, load: Array, rim_speed: Array, direction: Array, travel: Array, usual: Usual
) -> Array:
    """Conditions (n, d) of one run, in units of the lengths above.

    slip [-], load [N], rim_speed [m/s] (positive), direction ±1, travel of the rim since the run
    began [m]: each (n,).
    """
    slip, weight = np.clip(slip, -1.0, 1.0), np.log(np.maximum(load, 1e-3) / usual.load)
    speed = np.log(np.maximum(rim_speed, 1e-6) / usual.rim_speed)
    lags = [trailing(slip, travel, length) - slip for length in TRAVELS]
    load_lag = trailing(weight, travel, LOAD_TRAVEL) - weight

    start = np.exp(-np.abs(travel) / START_TRAVEL)

    lengths = (SLIP, LOAD, SPEED, DIRECTION, *(LAG,) * len(TRAVELS), LOAD_LAG, START)
    parts = (slip, weight, speed, direction, *lags, load_lag, start)
    return np.column_stack([part / length for part, length in zip(parts, lengths, strict=True)])
