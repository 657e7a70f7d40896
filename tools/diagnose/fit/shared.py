"""What the rig did already: the library's own effects in both campaigns, as a term of the fit.

With a reference campaign an effect is named for what is new. A rig of which the reference shows a
gear's ripple, a sidewall that rubs or soil that relaxes has these in the new campaign too, and no
explanation of the reference is asked for. So every effect of the library may act in both campaigns
with one strength,

    Σₑ aₑ Sₑ(x),   aₑ ~ N(0, 1) in expected sizes, times a size that is learnt,

linear about the rough fit, reduced to the directions that the recordings can show. The drive, the
soil, the instruments, and what changes with time or place have a size each: a gear that rubs much
says nothing of the soil, and soil that shears otherwise says nothing of soil that dries. A ripple
keeps its order and its size, but not its phase: each run has its own. It may be faster than the
grid: the grid's values are means over an interval, which damp it, and what is left is an alias of
known size. A run of larger forces or torques may ripple more in proportion, as a gear does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.effects.base import Effect, order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.functions import BEYOND_FORM
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes, even, random_effect
from gritd.tools.diagnose.fit.ripples import restored
from gritd.tools.diagnose.fit.signatures import raw_signatures
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN, SQUARE

CHANGES = "changes"  # what varies with time, heat, place or run
# what all other effects are of, and their stages
PARTS = {
    CHANGES: (),
    "drive": ("drivetrain",),
    "soil": ("soil", "contact", "wheel"),
    "instruments": ("sensor", "testbed", "any"),
}


def shared_columns(stack: Stack, u: Array, predicted: Array) -> dict[str, Array]:
    """Signatures (N, m) of all effects but ripples in both campaigns, about a prediction (N,) at
    constants u (q,), by what they are effects of; each effect of one expected size together.
    """
    names = [name for name, effect in stack.rig.effects.items() if order_of(effect) is None]
    columns: dict[str, list[Array]] = {part: [np.zeros((stack.size, 0))] for part in PARTS}
    for name in names:
        every = list(raw_signatures(stack, u, predicted, [name], everywhere=True))
        own = columns[_part_of(stack.rig.effects[name])]
        own += [s.columns / np.sqrt(len(every)) for s in every]
    return {part: np.column_stack(each) for part, each in columns.items()}


def _part_of(effect: type[Effect]) -> str:
    if effect.fingerprint.covariate in BEYOND_FORM:
        return CHANGES
    return next(part for part, stages in PARTS.items() if effect.stage in stages)


def rippling_columns(stack: Stack, residual: Array) -> Array:
    """Cosine and sine (N, m) of the orders that stand out of the reference's residual (N,), of the
    size that they have there; of every run and channel its own.
    """
    pairs = sorted(_ripples(stack, residual), key=lambda pair: int(np.argmax(np.any(pair, axis=1))))
    return np.column_stack([np.zeros((stack.size, 0)), *pairs])


def without_ripples(stack: Stack, residual: Array, ripples: Array) -> Array:
    """A residual (N,) less what ripples (N, r) can be of it, as its differences from one value to
    the next tell: a slow misfit hardly changes them. In each run and channel for itself. Good for
    such differences alone: a long wave is hardly known by them.
    """
    left = residual.copy()
    for channel, number in stack.parts:
        index = np.flatnonzero(stack.of(channel) & (stack.run == number))
        own = ripples[index][:, np.any(ripples[index], axis=0)]
        if own.shape[1]:
            left[index] -= own @ _least_absolute(np.diff(own, axis=0), np.diff(residual[index]))
    return left


def _least_absolute(columns: Array, values: Array) -> Array:
    """Weights (m,) of columns (n, m) by which they leave the least sum of absolute values of (n,):
    a change of slip is a few large differences. Iteratively weighted squares.
    """
    weights: Array = np.ones(values.size)
    share: Array = np.zeros(columns.shape[1])
    for _ in range(TUNING.fit.calming_rounds):
        root = np.sqrt(weights)
        share = np.asarray(np.linalg.lstsq(root[:, None] * columns, root * values, rcond=None)[0])
        off = np.abs(values - columns @ share)
        weights = 1.0 / np.maximum(off, max(float(np.median(off)), SQUARE))
    return share


def shared_terms(
    noise: Noise, shared: Mapping[str, Array], ripples: Array
) -> tuple[RandomEffect, ...]:
    """Terms of the effects (N, m) by what they are of, and the ripples (N, r)."""
    sizes = even(TUNING.fit.shared_sizes)
    terms = [
        random_effect(_name(part), _reduced(columns, whiten(noise, columns)), noise, sizes)
        for part, columns in shared.items()
    ]
    terms.append(random_effect("ripples in both", ripples, noise, Sizes()))
    return tuple(f for f in terms if f.columns.count)


def lasting(terms: Sequence[RandomEffect], sizes: Chosen) -> tuple[RandomEffect, ...]:
    """The terms with what varies with time, heat, place or run no larger than its size in the
    reference. Where nothing dried, warmed up or crept then, it is news if something does now.
    """
    return tuple(
        replace(f, sizes=f.sizes.up_to(number)) if f.name == _name(CHANGES) else f
        for f, number in zip(terms, sizes, strict=True)
    )


def _name(part: str) -> str:
    return f"{part} in both"


def _reduced(columns: Array, whitened: Array) -> Array:
    """Combinations of columns with the same covariance, the largest first; without those that
    are less than the noise altogether.
    """
    if not columns.shape[1]:
        return columns
    values, vectors = np.linalg.eigh(whitened.T @ whitened)
    large = np.flatnonzero(values > TUNING.fit.shared_least)[::-1][: TUNING.fit.shared_most]
    return np.asarray(columns @ vectors[:, large])


@dataclass(frozen=True, eq=False)
class _Waves:
    """Every order tried, on the values of one run and channel.

    wave:  e^(i order angle) (n, o), damped as means over the grid's interval damp it.
    shown: half the sum of the squared damping (o,); 0 where the grid hardly shows the order.
    """

    index: Index
    wave: NDArray[np.complex128]
    shown: Array

    def squares(self, values: Array) -> Array:
        """That each order takes of values (N,): (o,)."""
        part = values[self.index] - values[self.index].mean()
        power = np.abs(part @ self.wave) ** 2
        return np.asarray(power / np.where(self.shown > 0.0, self.shown, np.inf))

    def without(self, values: Array, order: int) -> Array:
        """Values (N,) less one order's part of them."""
        out = values.copy()
        if self.shown[order] > 0.0:
            pair = np.column_stack((self.wave[:, order].real, self.wave[:, order].imag))
            own = values[self.index]
            out[self.index] = own - pair @ np.linalg.lstsq(pair, own, rcond=None)[0]
        return out


def _ripples(stack: Stack, residual: Array) -> Iterator[Array]:
    """Pairs (N, 2) of all channels, orders and runs."""
    usual_orders = _orders(stack)
    moving = stack.covariate("speed") > 0.0

    for channel in stack.rig.channels if usual_orders.size else ():
        own = stack.of(channel) & moving
        shown = [line.at for line in restored(stack.rig, channel)]
        orders = np.union1d(usual_orders, shown)
        whole = _undamped(stack, channel, orders)
        waves = {n: _waves(stack, own, n, orders, whole) for n in np.unique(stack.run[own])}
        of_reference = [w for n, w in waves.items() if not stack.rig.new[n]]
        usual = _level(stack, [w.index for w in of_reference])

        for order, amplitude in _standing(of_reference, residual):
            for wave in (w for w in waves.values() if w.shown[order] > 0.0):
                size = amplitude * max(_level(stack, [wave.index]) / max(usual, SQUARE), 1.0)
                pair = np.zeros((stack.size, 2))
                pair[wave.index, 0] = size * wave.wave[:, order].real
                pair[wave.index, 1] = size * wave.wave[:, order].imag
                yield pair


def _level(stack: Stack, parts: Sequence[Index]) -> float:
    """Root mean square of what was measured."""
    values = np.concatenate([np.zeros(0), *(stack.measured[index] for index in parts)])
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _orders(stack: Stack) -> Array:
    """Ripples a turn that are tried (o,); none where the wheel hardly turns. A run must hold a few
    of them.
    """
    fit = TUNING.fit
    turns = max(float(np.ptp(r.covariates["wheel_angle"])) for r in stack.rig.runs) / (2.0 * np.pi)
    lowest = max(fit.lowest_ripple, TUNING.orders.cycles / max(turns, SPAN))
    return np.arange(lowest, fit.highest_order + fit.ripple_spacing, fit.ripple_spacing)


def _undamped(stack: Stack, channel: str, orders: Array) -> Bools:
    """Orders (o,) that stand on the grid as they are at its times: the recordings show them at
    their own rate.
    """
    whole = np.zeros(orders.size, bool)
    for line in restored(stack.rig, channel):
        whole |= np.abs(orders - line.at) < max(line.cell, TUNING.fit.ripple_spacing)
    return whole


def _waves(stack: Stack, own: Bools, number: int, orders: Array, whole: Bools) -> _Waves:
    """On the marked values of one run: sin(x)/x of what an interval turns damps a ripple and, where
    it is an alias of what lies above the grid's rate, turns its sign; but not the marked orders.
    """
    run = stack.rig.runs[number]
    angle = run.covariates["wheel_angle"]
    turned = np.gradient(angle) / (2.0 * np.pi)  # in one interval

    index = np.flatnonzero(own & (stack.run == number))
    time = stack.time[index]
    damping = np.sinc(np.outer(np.interp(time, run.time, turned), orders))
    damping[:, whole] = 1.0

    wave = np.exp(1j * np.outer(np.interp(time, run.time, angle), orders)) * damping
    seen = np.mean(damping**2, axis=0) > TUNING.fit.ripple_shown**2
    return _Waves(index, wave, np.where(seen, 0.5 * np.sum(damping**2, axis=0), 0.0))


def _standing(runs: Sequence[_Waves], residual: Array) -> Iterator[tuple[int, float]]:
    """The strongest orders in the runs, and the amplitude of each: those that gain more than chance
    in any of so many.
    """
    count = sum(w.index.size for w in runs)
    left = residual

    for _ in range(TUNING.fit.standing_orders if count >= TUNING.fit.ripple_values else 0):
        squares = np.sum([w.squares(left) for w in runs], axis=0)
        best = int(np.argmax(squares))
        whole = sum(float(np.sum(left[w.index] ** 2)) for w in runs)
        gain = 0.5 * count * np.log1p(squares[best] / max(whole - squares[best], SQUARE))
        if gain < TUNING.fit.standing_ripple:
            return

        shown = sum(float(w.shown[best]) for w in runs)
        yield best, float(np.sqrt(squares[best] / shown))
        for w in runs:
            left = w.without(left, best)
