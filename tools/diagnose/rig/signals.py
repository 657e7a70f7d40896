"""Recordings to signals on one time grid: block means of analogue channels, fitted slopes of
encoders.

Every value is a mean over one grid interval of readings placed by their stamps less the channel's
latency, so jitter and dropped samples only change how many readings stand behind it; an interval
with too few of them is NaN.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gritd.estimator.config.settings import Calibration, Channel, Settings
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.gaps import edges_of
from gritd.estimator.offline.streams import RAW
from gritd.estimator.offline.windows import Slopes, block_bend, block_mean, block_slope
from gritd.estimator.recording.mcapfile import RecordingError, opened
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.diagnose.tuning import TUNING

NS = 1e-9
PIECE = 1 << 20  # [bytes] of a file read at once
Series = tuple[Array, Array]  # times [s] in order, and values


@dataclass(frozen=True)
class Signals:
    """One recording on its grid; arrays (n,), NaN where there is nothing. SI, calibrated."""

    name: str
    info: RunInfo
    start: float  # [s since the epoch] of time 0
    time: Array  # [s] middle of each interval
    wheel_angle: Array  # [rad]
    wheel_speed: Array  # [rad/s]
    wheel_acceleration: Array  # [rad/s²] mean of each interval, as the analogue channels are
    carriage_angle: Array
    carriage_rate: Array  # [rad/s] of the pulley
    # relative standard deviation of the ratio of both speeds, of what the encoders' counts leave of
    # it
    doubt: Array
    # sinkage, current, temperature, drawbar_pull, side_force, load, axle_torque; those there are
    analogue: dict[str, Array]
    left_out: str = ""  # what of the recording is not used, in words


def read_all(paths: Sequence[Path]) -> list[Recording]:
    """Raises CommandError, one line, for a file that cannot be read."""
    return [read_one(path) for path in paths]


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
        if time.size < TUNING.rig.drive_readings:
            raise _too_little(
                recording, f"{time.size or 'no'} readings of {name}", "some seconds of a run"
            )
    return series


def _too_little(recording: Recording, amount: str, expected: str) -> CommandError:
    damage = f" ({recording.damage[0]})" if recording.damage else ""
    return CommandError(f"{recording.path}: found {amount}; expected {expected}{damage}", DAMAGED)


def sha256(path: Path) -> str:
    """Of a file's bytes. Raises CommandError where it cannot be read."""
    digest = hashlib.sha256()
    try:
        with opened(path) as file:
            while piece := file.read(PIECE):
                digest.update(piece)
    except OSError as error:
        raise CommandError(f"{path}: cannot read: {error.strerror or error}", _code(path)) from None
    return digest.hexdigest()


def distinct(paths: Sequence[Path]) -> dict[str, str]:
    """SHA-256 of every file. Raises CommandError where two are the same: a run counted twice would
    prove nothing.
    """
    seen: dict[str, Path] = {}
    for path in paths:
        checksum = sha256(path)
        if checksum in seen:
            same = f"found the same recording as {seen[checksum]}"
            raise CommandError(f"{path}: {same}; expected each run once", USAGE)
        seen[checksum] = path

    return {str(path): checksum for checksum, path in seen.items()}


def in_order(paths: Sequence[Path]) -> list[Path]:
    """The recordings by name, those of one name by content: no result depends on the order in which
    they are given. A rig orders the runs of a campaign by their time, as far as that tells.
    """
    names = [path.name for path in paths]
    content = {p: sha256(p) if names.count(p.name) > 1 else "" for p in paths}
    return sorted(paths, key=lambda path: (path.name, content[path]))


def read_one(path: Path) -> Recording:
    """Raises CommandError, one line, for a file that cannot be read."""
    try:
        return read(path, tables=RAW)  # one pass over the file for all channels
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
        if series.get(name, _NONE)[0].size < TUNING.rig.encoder_readings
    ]
    if missing:
        raise _too_little(recording, f"too few readings of {missing[0]}", "both encoders")

    encoders = [series["wheel_encoder"], series["carriage_encoder"]]
    edges, left_out = _grid(recording, encoders, rate)
    wheel, carriage = (block_slope(*encoder, edges) for encoder in encoders)
    analogue = {
        name: block_mean(*values, edges)
        for name, values in _analogue(recording, settings, series).items()
    }

    return Signals(
        recording.run.name or recording.path.stem,
        recording.run,
        float(edges[0]),
        0.5 * (edges[1:] + edges[:-1]) - edges[0],
        *wheel[:2],
        block_bend(*encoders[0], edges),
        *carriage[:2],
        doubt(wheel, carriage),
        {name: values for name, values in analogue.items() if np.isfinite(values).any()},
        left_out,
    )


def in_runs(series: Sequence[Signals]) -> list[Signals]:
    """Signals run by run: of a table of steady states every row is a run of its own."""
    return [run for s in series for run in (_rows(s) if s.info.steady_states else [s])]


def _rows(signals: Signals) -> list[Signals]:
    """The rows of a table, parted by silence."""
    heard = np.zeros(signals.time.size, bool)
    for values in signals.analogue.values():
        heard |= np.isfinite(values)
    edges = np.flatnonzero(np.diff(heard.astype(int), prepend=0, append=0)).reshape(-1, 2)
    if len(edges) < 2:
        return [_row(signals, slice(*edge), signals.name) for edge in edges] or [signals]
    named = ((f"{signals.name}, row {n}", edge) for n, edge in enumerate(edges, start=1))
    return [_row(signals, slice(*edge), name) for name, edge in named]


def _row(signals: Signals, at: slice, name: str) -> Signals:
    """One speed of wheel and carriage: how far they drove, and what came before, a table does not
    tell.
    """
    begins = float(signals.time[at.start])

    def held(values: Array) -> Array:
        return np.full(at.stop - at.start, np.nanmedian(values[at]))

    return replace(
        signals,
        name=name,
        start=signals.start + begins,
        time=signals.time[at] - begins,
        wheel_angle=held(signals.wheel_angle),
        wheel_speed=held(signals.wheel_speed),
        wheel_acceleration=np.zeros(at.stop - at.start),
        carriage_angle=held(signals.carriage_angle),
        carriage_rate=held(signals.carriage_rate),
        doubt=held(signals.doubt),
        analogue={channel: values[at] for channel, values in signals.analogue.items()},
    )


def series_of(recording: Recording, settings: Settings) -> dict[str, Series]:
    """The wheel's encoder [rad] and the analogue channels as they were read, by name; times since
    the epoch [s].
    """
    series = {name: _series(recording, channel) for name, channel in settings.channels.items()}
    wheel = {"wheel_encoder": series["wheel_encoder"]}
    return wheel | _analogue(recording, settings, series)


def _grid(recording: Recording, encoders: Sequence[Series], rate: float) -> tuple[Array, str]:
    """Edges [s] of the grid where both encoders speak, and what of the recording it leaves out."""
    beats = np.sort(np.concatenate([time for time, _ in encoders]))
    start, end = max(t[0] for t, _ in encoders), min(t[-1] for t, _ in encoders)
    within = beats[beats <= min(end, start + TUNING.rig.longest)]
    left_out = ""
    if end > start + TUNING.rig.longest:
        end = within[-1]
        left_out = (
            f"Nothing is used of {recording.path} from {TUNING.rig.longest:.0f} s after its"
            " beginning."
        )

    if (end - start) * rate < TUNING.rig.encoder_readings:
        overlap = f"{max(end - start, 0.0):.2f} s of both encoders together"
        raise _too_little(recording, overlap, "some seconds")
    try:
        return edges_of(within, start, end, rate), left_out
    except RecordingError as error:
        raise CommandError(f"{recording.path}: {error}", DAMAGED) from None


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
        "side_force": ("fy", wrench.side_force),
        "load": ("fz", wrench.load),
        "axle_torque": ("ty", wrench.torque),
    }

    return analogue | {
        name: _ordered(time, physical(rows[axis], c))
        for name, (axis, c) in axes.items()
        if c is not None
    }


def _series(recording: Recording, channel: Channel) -> Series:
    """Times [s] and physical values of a channel in order of time, less readings out of range."""
    rows = recording.arrays(f"/raw/{channel.name}")
    if not rows.size:
        return _NONE

    names = rows.dtype.names or ()
    raw = rows[next(n for n in ("count", "volts", "celsius") if n in names)].astype(float)
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


def doubt(wheel: Slopes, carriage: Slopes) -> Array:
    """Relative standard deviation of the ratio of two speeds (n,); 0 where one of them stands."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.hypot(wheel.sigma / wheel.rate, carriage.sigma / carriage.rate)
    return np.where(np.isfinite(share), share, 0.0)


def filled(values: Array) -> Array:
    """Values (n,), NaN bridged by straight lines."""
    good = np.isfinite(values)
    at = np.arange(values.size)
    return np.interp(at, at[good], values[good]) if good.any() else np.zeros(values.size)
