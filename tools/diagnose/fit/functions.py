"""Misfits without a name: smooth functions of covariates, offsets between runs, ripples a turn; one
channel each.

They say where a misfit lives, alarm when no listed effect would, and are the saturated model
against which the best listed explanation is measured.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SIZE, SPAN

TOLERATED = ("constant", "slip", "speed", "load", "sinkage", "acceleration")  # and products of two
LONG = ("position", "time", "heat")  # covariates along which waves stand for any smooth function
BEYOND_FORM = {*LONG, "run"}  # covariates over which no form of the model varies


def smooth_signatures(stack: Stack, everywhere: bool = False) -> tuple[Signature, ...]:
    """One for each channel and covariate (or product of two) that varies, heat for what the motor
    tells alone; everywhere: in the reference campaign too.
    """
    signatures = []
    for channel in stack.rig.channels:
        own = stack.of(channel)
        size = size_of(stack, channel)

        for along, columns in _families(stack):
            if along == ("heat",) and channel not in stack.rig.heated:
                continue
            acting = (own if everywhere else own & stack.new)[:, None]
            kept = _scaled(np.where(acting, columns, 0.0), own, size)
            if kept.shape[1]:
                signatures.append(Signature(Shape(channel, along), kept, (0,) * kept.shape[1], {}))

    return tuple(signatures)


def size_of(stack: Stack, channel: str) -> float:
    """The expected size of a misfit of a channel, in its unit."""
    own = stack.of(channel)
    return (
        TUNING.fit.misfit_size * float(np.sqrt(np.mean(stack.measured[own] ** 2)))
        if own.any()
        else 0.0
    )


def tolerance(stack: Stack, share: float) -> Array:
    """Smooth columns (N, t) by which the model may be off, together a share of the channel; each
    one its own σ.
    """
    columns = []
    for channel in stack.rig.channels:
        own = stack.of(channel)
        size = share * float(np.sqrt(np.mean(stack.measured[own] ** 2))) if own.any() else 0.0
        families = [f for along, f in _families(stack) if _tolerated(along)]
        scaled = _scaled(np.where(own[:, None], np.column_stack(families), 0.0), own, 1.0)
        columns.append(scaled * size / np.sqrt(max(scaled.shape[1], 1)))

    return np.column_stack(columns) if columns else np.zeros((stack.size, 0))


def _tolerated(along: tuple[str, ...]) -> bool:
    return len(along) > 1 or along[0] in TOLERATED


def shares(stack: Stack, own: Bools) -> Array:
    """Smooth functions (N, m) of unit size on some values: of slip, speed, load, sinkage, time,
    place, heat; and 1.
    """
    columns = []
    for along, family in _families(stack):
        if len(along) > 1 or along[0] not in ("run", "wheel_angle", "acceleration", "direction"):
            bent = len(along) == 1 and along[0] in LONG
            columns.append(family[:, : TUNING.fit.cosines] if bent else family)
    return _scaled(np.column_stack(columns), own, 1.0)


def along_place(stack: Stack) -> Array:
    """Cosines along the bed (N, m) of unit size while the wheel turns, from long to short waves;
    (N, 0) where nothing travels.
    """
    place, moving = stack.covariate("position"), stack.covariate("speed") > 0.0
    span = float(np.ptp(place))
    if span <= SPAN:
        return np.zeros((stack.size, 0))
    along = (place - place.min()) / span
    waves = np.cos(np.pi * np.outer(along, np.arange(1, TUNING.fit.place_waves + 1)))
    return _scaled(waves * moving[:, None], np.ones(stack.size, bool), 1.0)


def along(stack: Stack, covariate: str) -> Array:
    """Functions (N, m) of unit size: of time, place or heat cosines, of runs one each; (N, 0) where
    the covariate does not vary.
    """
    if covariate == "run":
        runs = (stack.run[:, None] == np.arange(len(stack.rig.runs))).astype(float)
        columns = runs if len(stack.rig.runs) > 1 else runs[:, :0]
    else:
        waves = _waves(stack.covariate(covariate))
        columns = np.zeros((stack.size, 0)) if waves is None else waves
    return _scaled(columns, np.ones(stack.size, bool), 1.0)


def _families(stack: Stack) -> Iterator[tuple[tuple[str, ...], Array]]:
    """Covariates, and functions of them (N, m) while the wheel turns."""
    moving = np.where(stack.covariate("speed") > 0.0, 1.0, 0.0)
    # friction acts while the wheel turns, an offset always
    yield ("constant",), np.column_stack((moving, 1.0 - moving))

    for names in stack.rig.smooth:
        parts = [_standard(stack.covariate(name), moving > 0) for name in names]
        if any(p is None for p in parts):
            continue
        value = np.prod([p for p in parts if p is not None], axis=0) * moving
        powers = (value, value**2 - moving * np.mean(value**2)) if len(names) == 1 else (value,)
        yield names, np.column_stack(powers)

    for name in LONG:
        waves = _waves(stack.covariate(name))
        if waves is not None:
            yield (name,), waves * moving[:, None]

    for name in ("acceleration", "direction"):
        part = _standard(stack.covariate(name), moving > 0)
        if part is not None:
            yield (name,), part[:, None]

    if len(stack.rig.runs) > 2:
        runs = (stack.run[:, None] == np.arange(len(stack.rig.runs))).astype(float)
        yield ("run",), runs * moving[:, None]

    angle = stack.covariate("wheel_angle")
    if np.ptp(angle) > 2.0 * np.pi:
        turns = [f(o * angle) * moving for o in TUNING.fit.form_harmonics for f in (np.cos, np.sin)]
        yield ("wheel_angle",), np.column_stack(turns)


def _waves(values: Array) -> Array | None:
    span = float(np.ptp(values))
    if span <= SPAN:
        return None
    along = (values - values.min()) / span
    return np.column_stack([np.cos(np.pi * k * along) for k in range(1, TUNING.fit.waves + 1)])


def _standard(values: Array, where: Bools) -> Array | None:
    inside = values[where]
    spread = float(np.std(inside)) if inside.size else 0.0
    if spread <= TUNING.fit.varies * max(float(np.abs(values).max()), SIZE):
        return None
    return np.asarray(
        np.clip((values - inside.mean()) / spread, -TUNING.fit.outlying, TUNING.fit.outlying)
    )


def _scaled(columns: Array, own: Bools, size: float) -> Array:
    """Columns of root mean square `size` on the channel; those that vanish there are left out."""
    rms = np.sqrt(np.mean(columns[own] ** 2, axis=0)) if own.any() else np.zeros(columns.shape[1])
    kept = rms > SPAN
    return columns[:, kept] / rms[kept] * size
