"""The discrepancy of form δ: what every model of a wheel in soil misses, as terms of the fit.

The size of δ is learnt from the recordings, under a prior that says how far published models miss
published measurements of drawbar pull and torque: half of it is at 3 and 10 %. (Shibly, Iagnemma
and Dubowsky (2005) report 2.0 and 2.6 % for their linearisation alone; docs/diagnosis.md has what
the equations miss of a published measurement.) δ is never zero by assumption. A rig that obeys the
equations shows so by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from gritd.estimator.model.discrepancy import features_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes, random_effect
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.rig.interface import Bools, FormSource
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


def form_terms(stack: Stack, noise: Noise) -> tuple[RandomEffect, ...]:
    """A term for each source of the rig; none for a rig that declares none."""
    terms = []
    for source in stack.rig.forms:
        columns = _columns(stack, source)
        if columns.shape[1]:
            lost = source.drive and stack.rig.loss_of_drive
            sizes = _drive_sizes() if lost else form_sizes()
            terms.append(
                random_effect(
                    source.name, columns, noise, sizes, kind="" if source.drive else "form"
                )
            )
    return tuple(terms)


def usual_sizes(stack: Stack, forms: Sequence[RandomEffect], model: Model) -> Chosen:
    """Of each term which of its sizes is the largest that is no news.

    Beside a reference, and where nothing is known of it, that is any. One that a configuration
    holds may be off, as fitted, by the share by which the published laws of an effect differ.
    """
    held = _held(stack)
    out = []
    for number, one in enumerate(forms):
        most = len(one.sizes.values) - 1
        if one.name in held:
            off = _rms(one.columns.times(model.of_form(number)))
            usual = off <= max(TUNING.fit.form_error_sizes) * _rms(held[one.name])
            most = model.sizes[number] if usual else 0
        out.append(most)
    return tuple(out)


def _held(stack: Stack) -> dict[str, Array]:
    """What a configuration holds of each term (N,), in the channels' units."""
    if stack.rig.held is None:
        return {}
    means = stack.joined(stack.rig.held.means)
    sources = [source for source in stack.rig.forms if not source.drive]
    own = {s.name: np.where(_weight(stack, s) != 0.0, means, 0.0) for s in sources}
    return {name: values for name, values in own.items() if values.any()}


def _rms(values: Array) -> float:
    """Where they are not nought."""
    acting = values[values != 0.0]
    return float(np.sqrt(np.mean(acting**2))) if acting.size else 0.0


def form_sizes() -> Sizes:
    """Shares of a channel that published models miss."""
    return Sizes(TUNING.fit.form_sizes, TUNING.fit.form_prior)


def _drive_sizes() -> Sizes:
    return Sizes(TUNING.fit.drive_sizes, TUNING.fit.drive_prior)


def of_differences(stack: Stack) -> Array:
    """Columns (N, m) of what is lost in a drive, each one as large as the torques whose difference
    it is: where that is nought, they are still as wrong as they are.
    """
    drives = (source for source in stack.rig.forms if source.drive)
    return np.column_stack([np.zeros((stack.size, 0)), *(_smooth(stack, s) for s in drives)])


def _columns(stack: Stack, source: FormSource) -> Array:
    """δ of one source (N, m), for a size of 1: as large as the channel itself."""
    columns = _smooth(stack, source)
    if not source.drive:
        return columns
    weight = _weight(stack, source)
    return _without(columns, np.column_stack((weight, np.sign(weight), stack.named)))


def _weight(stack: Stack, source: FormSource) -> Array:
    """(N,) of the channels of a source."""
    own = np.any([stack.of(c) for c in source.channels], axis=0)
    return np.asarray(joined(stack, source.weight) * own)


def _smooth(stack: Stack, source: FormSource) -> Array:
    """Functions of the conditions (N, m), as large as the channel itself."""
    weight = _weight(stack, source)
    acting: Bools = weight != 0.0
    if not acting.any():
        return np.zeros((stack.size, 0))

    features = _features(stack, source, acting)
    smooth = np.zeros((stack.size, features.shape[1]))
    smooth[acting] = features

    angle = stack.covariate("wheel_angle")
    turning = [
        TUNING.fit.form_turn * wave(k * angle)
        for k in TUNING.fit.form_harmonics
        for wave in (np.cos, np.sin)
    ]
    return np.column_stack((smooth, *turning)) * scale_of(stack, source)[:, None]


def scale_of(stack: Stack, source: FormSource) -> Array:
    """The size of a source's channels (N,) in proportion to the load, in their units."""
    weight = _weight(stack, source)
    size = _size(stack, source, weight != 0.0) if source.size is None else source.size
    return np.asarray(weight * size)


_formed: WeakKeyDictionary[Stack, dict[str, Array]] = WeakKeyDictionary()


def _features(stack: Stack, source: FormSource, acting: Bools) -> Array:
    """Of unit variance (n, m) on the n values where a source acts; formed once."""
    known = _formed.setdefault(stack, {})
    if source.name not in known:
        conditions = conditions_at(stack, source)[acting]
        shared = stack.referred
        most = TUNING.fit.form_features_shared if shared else TUNING.fit.form_features
        features = features_of(conditions, most, TUNING.fit.form_left_out)
        known[source.name] = features.at(conditions)
    return known[source.name]


def _without(columns: Array, named: Array) -> Array:
    """Columns (N, m) without what has a name (N, n), as what is constant or goes with the load: a
    discrepancy that could be all of a drive's friction would take its part (Plumlee 2017, J. Am.
    Stat. Assoc. 112, 1274-1285).
    """
    return np.asarray(columns - named @ np.linalg.lstsq(named, columns, rcond=None)[0])


def conditions_at(stack: Stack, source: FormSource) -> Array:
    """Of every value (N, d)."""
    return np.column_stack(
        [joined(stack, [run[:, i] for run in source.conditions]) for i in range(source.count)]
    )


def joined(stack: Stack, runs: list[Array] | tuple[Array, ...]) -> Array:
    """Per run (n,) to one vector (N,)."""
    return stack.joined([dict.fromkeys(stack.rig.channels, values) for values in runs])


def _size(stack: Stack, source: FormSource, acting: Bools) -> float:
    """Root mean square of the source's last channel where it acts, in its unit."""
    values = stack.measured[stack.of(source.channels[-1]) & acting]
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0
