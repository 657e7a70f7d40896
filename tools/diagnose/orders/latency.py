"""How late a channel is beside the motion: a shift in time, apart from a length of travel.

Around starts, stops, and changes of slip and load a channel y follows what the model makes of the
motion, ŷ. Of each such event the lag is fitted beside level and size,

    y(t) = a + b ŷ(t − d),

and the lags of all events are what a latency τ and a length of travel λ make of them,

    dᵢ = τ + λ/vᵢ,   v = ½ (r|ω| + |ẋ|).

A sensor that is late is so by the same time at every speed. Soil that is late is so by the same
length. At one speed alone the two cannot be distinguished, and both have a large σ.
Source: matching by cross-correlation, Knapp and Carter (1976), IEEE Trans. ASSP 24, 320-327.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPEED, SQUARE


@dataclass(frozen=True)
class Event:
    """The lag of a channel at one event [s], its σ by the noise, and the speed there [m/s]."""

    lag: float
    sigma: float
    speed: float


@dataclass(frozen=True)
class Latency:
    """Of a channel: τ [s], λ [m], their standard deviations, and the number of events."""

    channel: str
    delay: float
    delay_sigma: float
    length: float
    length_sigma: float
    events: int

    @property
    def sure(self) -> bool:
        """Whether the channel lags by more than chance and what a model of rest and motion is off
        by.
        """
        doubt = float(np.hypot(self.delay_sigma, TUNING.orders.lag_doubt))
        return abs(self.delay) > TUNING.orders.lag_sure * doubt


def changes(model: Array, step: float) -> Array:
    """How fast values (n,), `step` [s] apart, change [1/s], in units of their size."""
    count = max(round(TUNING.orders.event_smooth / step), 1)
    kernel = np.ones(count) / count
    smooth = np.convolve(np.pad(np.nan_to_num(model), count, mode="edge"), kernel, mode="same")
    rate = np.abs(np.gradient(smooth, step))[count:-count]
    size = float(np.quantile(np.abs(model), TUNING.orders.usual_size))
    return np.asarray(rate / max(size, SQUARE))


def events(rate: Array, step: float) -> list[slice]:
    """Windows about the places where something changes at a rate (n,) [1/s]."""
    reach = max(round(TUNING.orders.event_reach / step), 2)
    marked = np.flatnonzero(rate > TUNING.orders.event_change)
    if not marked.size:
        return []
    groups = np.split(marked, np.flatnonzero(np.diff(marked) > reach) + 1)
    ends = [(max(int(g[0]) - reach, 0), min(int(g[-1]) + reach + 1, rate.size)) for g in groups]
    return [slice(a, b) for a, b in ends]


def lag_of(time: Array, read: Array, model: Array, speed: Array) -> Event | None:
    """Of one event; None where the channel does not follow. time [s], read, model, speed [m/s]
    (n,).
    """
    known = np.isfinite(read) & np.isfinite(model)
    if known.sum() < TUNING.orders.event_values or np.ptp(model[known]) <= 0.0:
        return None
    time, read, model, speed = (values[known] for values in (time, read, model, speed))

    lag, farthest = 0.0, TUNING.orders.farthest_lag
    for _ in range(TUNING.orders.lag_rounds):
        shifted = np.interp(time - lag, time, model)
        slope = np.gradient(shifted, time)
        columns = np.column_stack((np.ones(time.size), shifted, -slope))
        (_, size, late), *_ = np.linalg.lstsq(columns, read, rcond=None)
        if size <= 0.0:
            return None
        lag = float(np.clip(lag + late / size, -farthest, farthest))

    left = read - columns @ np.linalg.lstsq(columns, read, rcond=None)[0]
    part = float(1.0 - np.var(left) / max(float(np.var(read)), SQUARE))
    if part < TUNING.orders.followed or abs(lag) >= farthest:
        return None
    products = np.linalg.inv(columns.T @ columns)
    colour = np.sqrt(TUNING.orders.event_colour * float(np.var(left)) * products[2, 2])
    usual = float(np.mean(speed[speed >= TUNING.orders.fast * speed.max()]))
    sigma = float(colour / size)
    return Event(lag, sigma, max(usual, SPEED)) if 0.0 < sigma < np.inf else None


def latency_of(channel: str, events: Sequence[Event]) -> Latency | None:
    """From the lags of all events, weighted by their noise and by what they scatter beyond it;
    None of too few.
    """
    if len(events) < TUNING.orders.least_events:
        return None
    lag, sigma, speed = np.array([(e.lag, e.sigma, e.speed) for e in events]).T
    columns = np.column_stack((np.ones(lag.size), 1.0 / speed))
    prior = np.array([0.0, 1.0 / TUNING.orders.usual_length])

    extra = 0.0
    for _ in range(TUNING.orders.lag_rounds):
        weights = 1.0 / (sigma**2 + extra**2)
        precision = (columns * weights[:, None]).T @ columns + np.diag(prior**2)
        covariance = np.linalg.inv(precision)
        values = covariance @ (columns.T @ (weights * lag))
        off = lag - columns @ values
        scatter = float(np.sum(off**2)) / (lag.size - 2)
        extra = float(np.sqrt(max(scatter - float(np.mean(sigma**2)), 0.0)))

    # few events tell their scatter badly: the variance of Student's t
    spread = np.sqrt(np.diag(covariance) * (lag.size - 2.0) / (lag.size - 4.0))
    delay, length = values.tolist()
    return Latency(channel, delay, float(spread[0]), length, float(spread[1]), lag.size)
