"""Recordings to signals on one time grid: block means of analogue channels, fitted slopes of
encoders.

Every value is a mean over one grid interval of readings placed by their stamps less the channel's
latency, so jitter and dropped samples only change how many readings stand behind it; an interval
with too few of them is NaN.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter, minimum_filter

from gritd.estimator.config.settings import Calibration, Channel, Settings
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.diagnose.rig.interface import Index

NS = 1e-9
LEAST = 0.3  # share of the usual number of readings below which an interval is not used
OUTLIER = 6.0  # [σ] from the interval's mean: one such reading is left out
QUICK, STEADY, LONG = 1, 4, 12  # intervals to either side over which an encoder's slope is fitted
GROWN = 1.2  # what the longest line may leave, in what short ones leave
CALM = 4.0  # [σ] within which the two slopes are the same


Series = tuple[Array, Array]  # times [s] in order, and values


@dataclass(frozen=True)
class Signals:
    """One recording on its grid; arrays (n,), NaN where there is nothing. SI, calibrated."""

    name: str
    path: Path
    info: RunInfo
    start: float  # [s since the epoch] of time 0
    time: Array  # [s] middle of each interval
    wheel_angle: Array  # [rad]
    wheel_speed: Array  # [rad/s]
    carriage_angle: Array
    carriage_rate: Array  # [rad/s] of the pulley
    # relative standard deviation of the ratio of both speeds, of what the encoders' counts leave of
    # it
    doubt: Array
    analogue: dict[
        str, Array
    ]  # sinkage, current, temperature, drawbar_pull, load, axle_torque; those there are
    damage: tuple[str, ...]


def read_all(paths: Sequence[Path]) -> list[Recording]:
    """Raises CommandError, one line, for a file that cannot be read."""
    return [_read(path) for path in paths]


def is_drive(recordings: Sequence[Recording]) -> bool:
    """A motor drive: it turns, and no carriage moves."""
    return not any(r.counts["/raw/carriage_encoder"] for r in recordings)


def drive_series(recording: Recording, settings: Settings) -> dict[str, Series]:
    """Position and current of a drive, as read. Raises CommandError."""
    series = {
        name: _series(recording, settings.channels[name])
        for name in ("wheel_encoder", "motor_shunt")
    }
    for name, (time, _) in series.items():
        if time.size < 100:
            raise _too_little(
                recording, f"{time.size or 'no'} readings of {name}", "some seconds of a run"
            )
    return series


def _too_little(recording: Recording, found: str, expected: str) -> CommandError:
    damage = f" ({recording.damage[0]})" if recording.damage else ""
    return CommandError(f"{recording.path}: found {found}; expected {expected}{damage}", DAMAGED)


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def distinct(paths: Sequence[Path]) -> dict[str, str]:
    """SHA-256 of every file. Raises CommandError where two are the same: a run counted twice would
    prove nothing.
    """
    checksums: dict[str, str] = {}
    for path in paths:
        checksum = sha256(path)
        if checksum in checksums.values():
            first = next(name for name, value in checksums.items() if value == checksum)
            raise CommandError(
                f"{path}: found the same recording as {first}; expected each run once", USAGE
            )
        checksums[str(path)] = checksum
    return checksums


def _read(path: Path) -> Recording:
    try:
        return read(path)
    except Exception as error:
        raise CommandError(
            f"{path}: {error}" if str(path) not in str(error) else error, _code(path)
        ) from None


def _code(path: Path) -> int:
    return DAMAGED if path.exists() else USAGE


def signals(recording: Recording, settings: Settings, rate: float) -> Signals:
    """One recording on its grid. Raises CommandError where it has no encoders."""
    series = {name: _series(recording, channel) for name, channel in settings.channels.items()}
    missing = [
        name
        for name in ("wheel_encoder", "carriage_encoder")
        if series.get(name, _NONE)[0].size < 10
    ]
    if missing:
        raise _too_little(recording, f"no readings of {missing[0]}", "both encoders")

    encoders = [series["wheel_encoder"], series["carriage_encoder"]]
    start, end = max(t[0] for t, _ in encoders), min(t[-1] for t, _ in encoders)
    count = int((end - start) * rate)
    if count < 5:
        raise _too_little(
            recording, f"{max(end - start, 0.0):.2f} s of both encoders together", "some seconds"
        )

    edges = start + np.arange(count + 1) / rate
    wheel, carriage = (slope(*encoder, edges) for encoder in encoders)
    analogue = {
        name: block_mean(*values, edges)
        for name, values in _analogue(recording, settings, series).items()
    }

    return Signals(
        recording.run.name or recording.path.stem,
        recording.path,
        recording.run,
        start,
        0.5 * (edges[1:] + edges[:-1]) - start,
        *wheel[:2],
        *carriage[:2],
        doubt(wheel, carriage),
        {name: values for name, values in analogue.items() if np.isfinite(values).any()},
        tuple(recording.damage),
    )


_NONE = (np.zeros(0), np.zeros(0))


def _analogue(
    recording: Recording, settings: Settings, series: dict[str, Series]
) -> dict[str, Series]:
    names = {"sinkage_pot": "sinkage", "motor_shunt": "current", "motor_temperature": "temperature"}
    analogue = {
        names[name]: series[name] for name in names if name in series and series[name][0].size
    }
    wrench = settings.wrench
    if wrench is None:
        return analogue
    rows = recording.arrays("/raw/wrench")
    if not rows.size:
        return analogue
    time = rows["stamp"] * NS - wrench.latency
    axes = {
        "drawbar_pull": ("fx", wrench.drawbar_pull),
        "load": ("fz", wrench.load),
        "axle_torque": ("ty", wrench.torque),
    }
    return analogue | {
        name: _ordered(time, physical(rows[axis], c)) for name, (axis, c) in axes.items()
    }


def _series(recording: Recording, channel: Channel) -> Series:
    """Times [s] and physical values of a channel in order of time, less readings out of range."""
    rows = recording.arrays(f"/raw/{channel.name}")
    if not rows.size:
        return _NONE
    raw = rows[
        next(name for name in ("count", "volts", "celsius") if name in (rows.dtype.names or ()))
    ].astype(float)
    good = np.isfinite(raw)
    if channel.name not in ("wheel_encoder", "carriage_encoder"):
        good &= (raw >= channel.low) & (raw <= channel.high)
    return _ordered(
        rows["stamp"][good] * NS - channel.latency, physical(raw[good], channel.calibration)
    )


def physical(raw: Array, calibration: Calibration) -> Array:
    """Raw values (n,) in the SI unit of the channel (n,)."""
    return np.asarray(raw * calibration.scale.value + calibration.offset.value, dtype=float)


def _ordered(time: Array, values: Array) -> Series:
    order = np.argsort(time, kind="stable")
    return time[order], values[order]


def block_mean(time: Array, values: Array, edges: Array) -> Array:
    """Mean of the readings in each interval (n,), moved to its middle; single readings far off are
    left out.
    """
    n = edges.size - 1
    block = np.searchsorted(edges, time, side="right") - 1
    inside = (block >= 0) & (block < n)
    block, time, values = block[inside], time[inside], values[inside]
    deviation = values - _median(block, values, n)[block]
    scale = 1.4826 * np.median(np.abs(deviation)) if deviation.size else 0.0
    kept = np.abs(deviation) <= OUTLIER * scale if scale > 0.0 else np.ones(block.size, bool)
    mean, count = _mean(block[kept], values[kept], n)
    at = _mean(block[kept], time[kept], n)[0]
    usual = np.median(count[count > 0]) if (count > 0).any() else 1.0
    enough = count >= LEAST * usual
    out = np.full(n, np.nan)
    if np.count_nonzero(enough) > 1:
        rate = np.gradient(mean[enough], at[enough])
        out[enough] = mean[enough] + rate * (0.5 * (edges[1:] + edges[:-1]) - at)[enough]
    return out


def _median(block: Index, values: Array, n: int) -> Array:
    """Median of each interval (n,); 0 where it is empty."""
    order = np.lexsort((values, block))
    count = np.bincount(block, minlength=n)
    middle = np.cumsum(count) - count + count // 2
    return np.where(count > 0, values[order[np.minimum(middle, max(values.size - 1, 0))]], 0.0)


def _mean(block: Index, values: Array, n: int) -> tuple[Array, Array]:
    count = np.bincount(block, minlength=n).astype(float)
    return np.bincount(block, weights=values, minlength=n) / np.maximum(count, 1.0), count


class Turned(NamedTuple):
    """An encoder on the grid (n,)."""

    angle: Array
    rate: Array
    sigma: Array  # of the rate


def doubt(wheel: Turned, carriage: Turned) -> Array:
    """Relative standard deviation of the ratio of two speeds (n,); 0 where one of them stands."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.hypot(wheel.sigma / wheel.rate, carriage.sigma / carriage.rate)
    return np.where(np.isfinite(share), share, 0.0)


def slope(time: Array, values: Array, edges: Array) -> Turned:
    """Value and slope of an encoder at the middle of each of n intervals, edges (n + 1,) [s].

    By a line fitted over the interval and its neighbours, QUICK to either side; where the slope is
    steady within its own noise, STEADY or LONG to either side, if that line leaves no more than the
    short one: at creeping speed one count is much of the slip, and counts that beat with the
    sampling make slow waves of what was steady.
    """
    best, left = _line(time, values, edges, QUICK)
    quick, calm = best.rate, np.ones(best.rate.size, bool)
    for reach in (STEADY, LONG):
        far, more = _line(time, values, edges, reach)
        off = np.abs(np.nan_to_num(quick - far.rate))
        usual = median_filter(left, 2 * reach + 1, mode="nearest")
        same = (off <= CALM * 1.4826 * np.median(off)) & (
            (reach == STEADY) | (more <= GROWN * usual)
        )
        calm = calm & minimum_filter(same, 2 * reach + 1, mode="nearest") & np.isfinite(far.rate)
        best = Turned(*(np.where(calm, one, other) for one, other in zip(far, best, strict=True)))
    return best


def _line(time: Array, values: Array, edges: Array, reach: int) -> tuple[Turned, Array]:
    """Lines fitted over each interval and `reach` more on either side; the r.m.s. of what they
    leave (n,).
    """
    n, middle = edges.size - 1, 0.5 * (edges[1:] + edges[:-1]) - edges[0]
    block = np.searchsorted(edges, time, side="right") - 1
    inside = (block >= 0) & (block < n)
    block, t, y = block[inside], time[inside] - edges[0], values[inside]
    y = y - (first := y[0] if y.size else 0.0)

    weights = (np.ones(t.size), t, t * t, y, t * y, y * y)
    s0, s1, s2, y0, y1, y2 = (
        _spread(np.bincount(block, weights=w, minlength=n).astype(float), reach) for w in weights
    )

    with np.errstate(invalid="ignore", divide="ignore"):
        spread = s2 - s1 * s1 / s0
        rate = (y1 - s1 * y0 / s0) / spread
        at = first + y0 / s0 + rate * (middle - s1 / s0)
        left = np.sqrt(np.maximum(y2 - y0 * y0 / s0 - rate * (y1 - s1 * y0 / s0), 0.0) / s0)
    enough = s0 >= LEAST * np.median(s0)
    columns = (np.where(enough, x, np.nan) for x in (at, rate, left / np.sqrt(spread)))
    return Turned(*columns), np.where(enough, left, 0.0)


def _spread(sums: Array, most: int) -> Array:
    """Sums over an interval and `most` neighbours on either side; fewer at the ends."""
    total = np.concatenate(([0.0], np.cumsum(sums)))
    at = np.arange(sums.size)
    reach = np.minimum(np.minimum(at, at[::-1]), most)
    joined: Array = total[at + reach + 1] - total[at - reach]
    return joined
