"""What each effect would change: finite differences of all channels over its strengths, on a grid
of its shapes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, product
from typing import TypeVar

import numpy as np

from gritd.estimator.effects.base import Effect, Parameter
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SLIGHT, UNCHANGED, WAY

Taken = TypeVar("Taken")


def some_of(every: Iterable[Taken]) -> Iterator[list[Taken]]:
    """So many at a time that their columns are not all in memory at once."""
    taken = iter(every)
    while some := list(islice(taken, TUNING.numerics.at_once)):
        yield some


def strengths(effect: type[Effect]) -> list[Parameter]:
    return [p for p in effect.parameters() if p.role == "strength"]


def raw_signatures(
    stack: Stack,
    u: Array,
    base: Array,
    names: list[str] | None = None,
    everywhere: bool = False,
) -> Iterator[Signature]:
    """Unwhitened signatures of all candidates about the prediction (N,) at constants u (q,);
    everywhere: in the reference campaign too.
    """
    for name, effect in stack.rig.effects.items():
        if names is None or name in names:
            for fixed in shape_grid(stack.rig, effect):
                made = signature(stack, u, base, effect, fixed, everywhere=everywhere)
                if made is not None:
                    yield made


def signature(
    stack: Stack,
    u: Array,
    base: Array,
    effect: type[Effect],
    fixed: Mapping[str, float],
    others: tuple[Effect, ...] = (),
    everywhere: bool = False,
) -> Signature | None:
    """Of an effect about the prediction base (N,) at constants u (q,), its shape parameters fixed;
    everywhere: in the reference campaign too.

    None where the effect changes nothing that is measured, or runs away however weak it is.
    """
    derivatives = [
        _derivative(stack, u, base, effect, fixed, p, others, everywhere) for p in strengths(effect)
    ]
    columns = np.column_stack(derivatives)
    if not np.isfinite(columns).all() or not _shows(stack, base, columns):
        return None

    sign = tuple(int(p.low >= p.off) for p in strengths(effect))
    return Signature(effect.name, columns, sign, dict(fixed))


def _shows(stack: Stack, base: Array, columns: Array) -> bool:
    """Whether columns (N, p) change a channel of the prediction (N,) by more than its balance is
    solved to.
    """
    own = (stack.of(channel) for channel in stack.rig.channels)
    return any(
        np.abs(columns[of]).max(initial=0.0) > UNCHANGED * np.abs(base[of]).max(initial=0.0)
        for of in own
    )


def _derivative(
    stack: Stack,
    u: Array,
    base: Array,
    effect: type[Effect],
    fixed: Mapping[str, float],
    strength: Parameter,
    others: tuple[Effect, ...],
    everywhere: bool,
) -> Array:
    """Change of all values (N,) per expected size; by a smaller step where the full one runs away,
    as a motor may that heats the more the more current it draws; NaN where every step does.
    """
    largest = TUNING.numerics.runaway * np.abs(stack.measured).max(initial=0.0)

    for step in TUNING.fit.derivative_steps:
        acting = effect(**{**fixed, strength.name: strength.off + step * strength.sigma})
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            change = stack.predict(u, (*others, acting), everywhere, (u, others)) - base
        if np.isfinite(change).all() and np.abs(change).max(initial=0.0) <= step * largest:
            return np.asarray(change / step)

    return np.full(stack.size, np.nan)


def shape_grid(rig: Rig, effect: type[Effect]) -> Iterator[dict[str, float]]:
    """Values of the effect's shapes worth trying on these recordings, all combinations."""
    shapes = [p for p in effect.parameters() if p.role == "shape"]
    for values in product(*(_values(rig, p) for p in shapes)):
        yield {
            p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(shapes, values, strict=True)
        }


def _values(rig: Rig, parameter: Parameter) -> list[float]:
    if parameter.scan and parameter.unit == "s":
        length = max(float(np.ptp(run.time)) for run in rig.runs)
        campaign = max(float(run.time[-1]) for run in rig.runs)
        return sorted(
            {
                float(np.clip(f * t, parameter.low, parameter.high))
                for f in TUNING.fit.relative_times
                for t in (length, campaign)
            }
        )

    if parameter.scan and parameter.unit == "m":
        return _places(rig, parameter)
    if parameter.scan:
        return orders(rig, parameter)

    if parameter.centre == parameter.low:  # from none of it to all
        return [parameter.low, parameter.high]
    if parameter.sigma >= TUNING.fit.shape_known * abs(parameter.centre):
        return [factor * parameter.centre for factor in TUNING.fit.shape_factors]
    return [parameter.centre]


def _places(rig: Rig, parameter: Parameter) -> list[float]:
    """Lengths as shares of the bed that was driven; centres along it."""
    along = np.concatenate([run.covariates["position"] for run in rig.runs])
    low, high = float(along.min()), float(along.max())
    span = max(high - low, WAY)
    if "length" in parameter.name:
        return [share * span for share in TUNING.fit.patch_lengths]
    return [float(x) for x in np.linspace(low, high, TUNING.fit.patch_centres)]


def orders(rig: Rig, parameter: Parameter) -> list[float]:
    """Ripples a turn that the recordings show at their own rate. Without any, those that the grid
    can show: whole numbers, or as dense as the number of turns asks for.
    """
    if shown := rig.lines.orders(parameter.low, parameter.high):
        return shown
    top = min(parameter.high, highest_order(rig))
    least = max(parameter.low, TUNING.orders.cycles * resolved_order(rig))
    whole = np.arange(np.ceil(least), np.floor(top) + 1.0)
    return [float(x) for x in whole[:: max(1, -(-len(whole) // TUNING.fit.most_orders))]]


def resolved_order(rig: Rig) -> float:
    """Ripples a turn by which two ripples must differ for the longest run to distinguish them."""
    turned = max(float(np.ptp(run.covariates["wheel_angle"])) for run in rig.runs) / (2.0 * np.pi)
    return 1.0 / max(turned, SLIGHT)


def highest_order(rig: Rig) -> float:
    """The fastest ripple a turn that the grid shows, at the usual speed; 0 where nothing turns."""
    speed = np.concatenate(
        [np.abs(np.gradient(run.covariates["wheel_angle"], run.time)) for run in rig.runs]
    )
    turning = speed[speed > TUNING.rig.creep * speed.max()]
    if not turning.size:
        return 0.0
    rate = 1.0 / float(np.median(np.diff(rig.runs[0].time)))
    return TUNING.orders.nyquist * rate * 2.0 * np.pi / float(np.median(turning))
