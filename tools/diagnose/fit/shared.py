"""What the rig did already: the library's own effects in both campaigns, as a freedom of the fit.

With a reference campaign an effect is named for what is new. A rig of which the reference shows a
gear's ripple, a sidewall that rubs or soil that relaxes has these in the new campaign too, and no
explanation of the reference is asked for. So every effect of the library may act in both campaigns
with one strength,

    Σₑ aₑ Sₑ(x),   aₑ ~ N(0, 1) in expected sizes, times one size for all that is learnt,

linear about the rough fit, reduced to the directions that the recordings can show. A ripple keeps
its order and its size, but not its phase: each run has its own.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.freedom import Freedom, Sizes
from gritd.tools.diagnose.fit.signatures import (
    highest_order,
    order_of,
    raw_signatures,
)
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Bools, Stack
from gritd.tools.diagnose.tuning import TUNING


def shared_columns(stack: Stack, u: Array, predicted: Array) -> Array:
    """Signatures (N, m) of all effects but ripples in both campaigns, about a prediction (N,) at
    constants u (q,); each effect of one expected size together.
    """
    names = [name for name, effect in stack.rig.effects.items() if order_of(effect) is None]
    every = list(raw_signatures(stack, u, predicted, names, everywhere=True))
    shapes = {name: sum(s.of == name for s in every) for name in names}
    columns = [s.columns / np.sqrt(shapes[str(s.of)]) for s in every]
    return np.column_stack([np.zeros((stack.size, 0)), *columns])


def rippling_columns(stack: Stack, residual: Array) -> Array:
    """Cosine and sine (N, m) of the orders that stand out of the reference's residual (N,), of the
    size that they have there; of every run and channel its own.
    """
    return np.column_stack([np.zeros((stack.size, 0)), *_ripples(stack, residual)])


def shared_freedoms(noise: Noise, columns: Array, ripples: Array) -> tuple[Freedom, ...]:
    """Freedoms of the columns (N, m) and the ripples (N, r)."""
    reduced = _reduced(columns, whiten(noise, columns))
    sizes = Sizes(TUNING.fit.shared_sizes, TUNING.fit.shared_prior)
    found = [Freedom("effects in both", *reduced, sizes)]
    if ripples.shape[1]:
        once = Sizes((1.0,), (1.0,))
        found.append(Freedom("ripples in both", ripples, whiten(noise, ripples), once))
    return tuple(f for f in found if f.columns.shape[1])


def _reduced(columns: Array, whitened: Array) -> tuple[Array, Array]:
    """Combinations of columns with the same covariance, the largest first; without those that
    are less than the noise altogether.
    """
    if not columns.shape[1]:
        return columns, whitened
    values, vectors = np.linalg.eigh(whitened.T @ whitened)
    large = np.flatnonzero(values > TUNING.fit.shared_least)[::-1][: TUNING.fit.shared_most]
    return columns @ vectors[:, large], whitened @ vectors[:, large]


def _ripples(stack: Stack, residual: Array) -> Iterator[Array]:
    """Pairs (N, 2) of all channels, orders and runs."""
    orders = np.arange(TUNING.fit.lowest_ripple, highest_order(stack), TUNING.fit.ripple_spacing)
    moving = stack.covariate("speed") > 0.0
    angle = stack.covariate("wheel_angle")
    for channel in stack.rig.channels if orders.size else ():
        own = stack.of(channel) & moving
        for order, size in _standing(stack, angle, residual, own & ~stack.new, orders):
            for number in range(len(stack.rig.runs)):
                here = np.where(own & (stack.run == number), size, 0.0)
                if here.any():
                    waves = (np.cos(order * angle), np.sin(order * angle))
                    yield np.column_stack([here * wave for wave in waves])


def _standing(
    stack: Stack, angle: Array, residual: Array, own: Bools, orders: Array
) -> Iterator[tuple[float, float]]:
    """The strongest orders of the marked values, and the amplitude of each: those that gain more
    than chance in any of so many.
    """
    left = np.where(own, residual, 0.0)
    for _ in range(TUNING.fit.strongest_orders):
        squares, amplitudes = _spectrum(stack, angle, left, own, orders)
        best = int(np.argmax(squares))
        rest = float(np.sum(left[own] ** 2)) - squares[best]
        count = int(own.sum())
        gain = 0.5 * count * np.log1p(squares[best] / max(rest, 1e-300))
        if count < TUNING.fit.ripple_values or gain < TUNING.fit.standing_ripple:
            return
        yield float(orders[best]), float(amplitudes[best])
        left = left - _fitted(stack, angle, left, own, float(orders[best]))


def _spectrum(
    stack: Stack, angle: Array, values: Array, own: Bools, orders: Array
) -> tuple[Array, Array]:
    """Squares that each order takes (o,), with a phase for each run, and its amplitude (o,)."""
    squares, count = np.zeros(orders.size), 0
    for number in range(len(stack.rig.runs)):
        index = np.flatnonzero(own & (stack.run == number))
        if index.size:
            part = values[index] - values[index].mean()
            squares += (
                2.0 * np.abs(part @ np.exp(1j * np.outer(angle[index], orders))) ** 2 / (index.size)
            )
            count += index.size
    return squares, np.sqrt(2.0 * squares / max(count, 1))


def _fitted(stack: Stack, angle: Array, values: Array, own: Bools, order: float) -> Array:
    """The order's part of the values (N,), with a phase for each run."""
    out = np.zeros(values.size)
    for number in range(len(stack.rig.runs)):
        index = np.flatnonzero(own & (stack.run == number))
        if index.size:
            turn = order * angle[index]
            pair = np.column_stack((np.cos(turn), np.sin(turn)))
            out[index] = pair @ np.linalg.lstsq(pair, values[index], rcond=None)[0]
    return out
