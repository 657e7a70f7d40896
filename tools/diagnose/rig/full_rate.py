"""Recordings at their own rate: what is faster than the grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import accumulate

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import order_of
from gritd.estimator.offline.windows import block_mean
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.campaigns import Lines, lines_of
from gritd.tools.diagnose.orders.on_grid import on_grid
from gritd.tools.diagnose.orders.phases import guide, shifts
from gritd.tools.diagnose.orders.stretches import GridMotion, Samples, Series, steady_samples
from gritd.tools.diagnose.rig.signals import Signals, series_of
from gritd.tools.diagnose.tuning import TUNING

FullRate = Mapping[str, Series]  # wheel_encoder [rad], and analogue channels; times since the epoch


def with_lines(
    recordings: Sequence[Recording], signals: Sequence[Signals], settings: Settings, reference: int
) -> tuple[list[Signals], Lines]:
    """Signals with ripples as they stand at the grid's times, and the lines that the recordings
    hold. reference: so many of the runs, the first ones, are of a reference campaign.
    """
    reads = [partial(series_of, recording, settings) for recording in recordings]
    beside, lines = beside_lines(signals, reads, settings.drive.torque_constant.value, reference)
    return beside, replace(lines, configured=_configured_orders(settings))


def _configured_orders(settings: Settings) -> tuple[float, ...]:
    """Ripples a turn of the configured effects."""
    known = ((e.parameters, order_of(EFFECTS[e.name])) for e in settings.effects)
    return tuple(values[order].value for values, order in known if order in values)


def beside_lines(
    signals: Sequence[Signals],
    reads: Sequence[Callable[[], FullRate]],
    torque_constant: float,
    reference: int = 0,
) -> tuple[list[Signals], Lines]:
    """The same of signals and what reads their runs at full rate, one run at a time."""
    most = TUNING.numerics.most_samples // max(len(signals), 1)
    pairs = list(zip(signals, reads, strict=True))
    runs = [steady_readings(known, read(), most, torque_constant) for known, read in pairs]

    lines = lines_of(runs[reference:], runs[:reference])
    if not lines.every:
        return list(signals), lines
    beside = [restored(known, read(), lines) for known, read in pairs]
    beside[reference:], lines = aligned(beside[reference:], lines)
    return beside, lines


def steady_readings(
    signals: Signals, full: FullRate, most: int, torque_constant: float
) -> dict[str, Samples]:
    """Readings of each channel while the wheel drives steadily, at most so many, the current as the
    motor's torque; of a table of steady states none.
    """
    if signals.info.steady_states:
        return {}
    since = {channel_of(n): _since(signals, read) for n, read in full.items() if n != "temperature"}
    angle = since.pop("wheel_encoder")
    if "torque" in since:
        time, current = since["torque"]
        since["torque"] = time, torque_constant * current
    return steady_samples(_motion(signals), angle, since, most)


def channel_of(name: str) -> str:
    """The channel in which a reading is compared."""
    return "torque" if name == "current" else name


def restored(signals: Signals, full: FullRate, lines: Lines) -> Signals:
    """Signals with the lines as they stand at the grid's times."""
    if signals.info.steady_states:
        return signals

    angle, motion = _since(signals, full["wheel_encoder"]), _motion(signals)
    edges = _edges(signals.time)
    analogue = dict(signals.analogue)

    shown = {line.channel for line in lines.every}
    for name in (n for n in signals.analogue if channel_of(n) in shown):
        own, read = lines.of(channel_of(name)), _since(signals, full[name])
        less, ripple = on_grid(own, motion, angle, read, signals.time)
        analogue[name] = block_mean(*less, edges) + ripple
    return replace(signals, analogue=analogue)


def aligned(signals: Sequence[Signals], lines: Lines) -> tuple[list[Signals], Lines]:
    """Runs of the new campaign with wheel angles that count from one angle, as a ripple of its
    lines tells, and the lines with what aligned them.
    """
    line = guide(lines)
    if line is None:
        return list(signals), lines
    moved = shifts(line).tolist()
    turned = [
        replace(s, wheel_angle=s.wheel_angle + by) for s, by in zip(signals, moved, strict=True)
    ]
    return turned, replace(lines, aligned=line.at)


def _motion(signals: Signals) -> GridMotion:
    load = signals.analogue.get("load")
    return GridMotion(signals.time, signals.wheel_speed, signals.carriage_rate, load)


def _since(signals: Signals, read: Series) -> Series:
    """The same with times since the run began [s]."""
    time, values = read
    return time - signals.start, values


def _edges(middle: Array) -> Array:
    """Edges (n + 1,) [s] of intervals side by side, the first at 0, from their middles (n,)."""
    return np.array(list(accumulate(middle.tolist(), lambda e, m: 2.0 * m - e, initial=0.0)))
