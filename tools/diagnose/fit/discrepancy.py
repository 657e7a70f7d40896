"""The discrepancy of form δ: what every model of a wheel in soil misses, as freedoms of the fit.

The size of δ is learnt from the recordings, under a prior that says how far published models miss
published measurements of drawbar pull and torque: half of it is at 3 and 10 %. (Shibly, Iagnemma
and Dubowsky (2005) report 2.0 and 2.6 % for their linearisation alone; docs/diagnosis.md has what
the equations miss of a published measurement.) δ is never zero by assumption. A rig that obeys the
equations shows so by itself.
"""

from __future__ import annotations

import numpy as np

from gritd.estimator.model.discrepancy import features_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.freedom import Freedom, Sizes, freedom
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.rig.interface import Bools, FormSource
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


def form_freedoms(stack: Stack, noise: Noise) -> tuple[Freedom, ...]:
    """A freedom for each source of the rig; none for a rig that declares none."""
    freedoms = []
    for source in stack.rig.forms:
        columns = _columns(stack, source)
        if columns.shape[1]:
            sizes = _drive_sizes() if source.drive else _form_sizes()
            freedoms.append(freedom(source.name, columns, noise, sizes, of_form=not source.drive))
    return tuple(freedoms)


def _form_sizes() -> Sizes:
    return Sizes(TUNING.fit.form_sizes, TUNING.fit.form_prior)


def _drive_sizes() -> Sizes:
    return Sizes(TUNING.fit.drive_sizes, TUNING.fit.drive_prior)


def _columns(stack: Stack, source: FormSource) -> Array:
    """δ of one source (N, m), for a size of 1: as large as the channel itself."""
    own = np.any([stack.of(c) for c in source.channels], axis=0)
    weight = joined(stack, source.weight) * own
    acting: Bools = weight != 0.0
    if not acting.any():
        return np.zeros((stack.size, 0))

    conditions = conditions_at(stack, source)
    shared = stack.referred
    most = TUNING.fit.form_features_shared if shared else TUNING.fit.form_features
    features = features_of(conditions[acting], most, TUNING.fit.form_left_out)
    smooth = np.zeros((stack.size, len(features.points)))
    smooth[acting] = features.at(conditions[acting])

    angle = stack.covariate("wheel_angle")
    turning = [
        TUNING.fit.form_turn * wave(k * angle)
        for k in TUNING.fit.form_harmonics
        for wave in (np.cos, np.sin)
    ]
    size = _size(stack, source, acting) if source.size is None else source.size
    columns = np.column_stack((smooth, *turning)) * weight[:, None] * size
    return _without_levels(columns, weight) if source.drive else columns


def _without_levels(columns: Array, weight: Array) -> Array:
    """Columns (N, m) without what is constant or goes with the load: a drive's friction has names,
    and a discrepancy that could be all of it would take their part (Plumlee 2017, J. Am. Stat.
    Assoc. 112, 1274-1285).
    """
    levels = np.column_stack((weight, np.sign(weight)))
    return np.asarray(columns - levels @ np.linalg.lstsq(levels, columns, rcond=None)[0])


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
