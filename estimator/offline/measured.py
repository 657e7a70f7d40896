"""A recording on one time grid: measured motion and readings as arrays, calibrated, in SI.

Every value is the mean of its channel over one window around the grid time, every speed the slope
over it, so all channels see the same stretch of time. This is what the forward model is driven by
and compared with.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Calibration, Settings
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.stages.history import rate_of
from gritd.estimator.stages.situation import Motion, Sensed
from gritd.estimator.terramechanics.soil import Array

NS = 1e-9  # [s]
RATE = 25.0  # [Hz]
WINDOW = 0.1  # [s]
SENSED = ("sinkage", "current", "drawbar_pull", "load", "torque")


@dataclass(frozen=True)
class MeasuredRun:
    """One run; arrays (n,). A channel that was not recorded is NaN and not in `channels`."""

    motion: Motion
    sensed: Sensed
    channels: frozenset[str]  # of SENSED
    origin: int  # [ns] of motion.time 0


@dataclass(frozen=True)
class Track:
    """A channel's readings in order of time, with the integral that gives window means."""

    time: Array  # (m,) [s] from the origin, latency taken off
    value: Array  # (m,) physical
    integral: Array  # (m,) ∫ value dt from the first reading

    def mean(self, start: Array, end: Array) -> Array:
        """Mean between two times, (n,), values linear between readings."""
        mean: Array = (self._integral(end) - self._integral(start)) / (end - start)
        return mean

    def _integral(self, time: Array) -> Array:
        at = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 2)
        past, step = time - self.time[at], self.time[at + 1] - self.time[at]
        slope = (self.value[at + 1] - self.value[at]) / step
        whole: Array = self.integral[at] + past * (self.value[at] + 0.5 * slope * past)
        return whole


def measured_run(
    recording: Recording,
    settings: Settings,
    rate: float = RATE,
    window: float = WINDOW,
    origin: int | None = None,
) -> MeasuredRun:
    """The recording at `rate` [Hz], each value over `window` [s]. Time runs from `origin` [ns],
    else the first reading.

    The load that drives the forward model is the wrench's where there is one, else the run's
    nominal load, else the configured one. Raises RecordingError where an encoder is missing or too
    short for one window.
    """
    raw, half = _raw(recording, settings), 0.5 * window
    if origin is None:
        origin = min((int(stamps[0]) for stamps, _ in raw.values()), default=0)
    tracks = {name: _track(stamps, values, origin) for name, (stamps, values) in raw.items()}
    time = _grid(recording, tracks, rate, half)
    means = {name: track.mean(time - half, time + half) for name, track in tracks.items()}
    wheel_speed = _slope(tracks["wheel"], time, half)
    motion = Motion(
        time=time,
        wheel_angle=means["wheel"],
        wheel_speed=wheel_speed,
        carriage_position=means["carriage"] - tracks["carriage"].value[0],
        carriage_speed=_slope(tracks["carriage"], time, half),
        load=means.get("load", np.full(time.size, _weights(recording, settings))),
        pass_number=float(recording.run.pass_number),
        start_position=recording.run.start_position,
        wheel_acceleration=rate_of(time, wheel_speed),
    )
    sensed = Sensed(**{name: means.get(name, np.full(time.size, np.nan)) for name in SENSED})
    return MeasuredRun(motion, sensed, frozenset(SENSED) & means.keys(), origin)


def _grid(recording: Recording, tracks: Mapping[str, Track], rate: float, half: float) -> Array:
    """The times at which every channel has readings on both sides, `half` a window and more. Raises
    RecordingError.
    """
    for name in ("wheel", "carriage"):
        if name not in tracks:
            raise RecordingError(
                f"{recording.path}: /raw/{name}_encoder: no readings; expected an encoder"
            )
    first = max(float(track.time[0]) for track in tracks.values()) + half
    last = min(float(track.time[-1]) for track in tracks.values()) - half
    if last <= first:
        raise RecordingError(
            f"{recording.path}: channels overlap for less than {2.0 * half:g} s; expected more"
        )
    grid: Array = first + np.arange(int((last - first) * rate) + 1) / rate
    return grid


def _weights(recording: Recording, settings: Settings) -> float:
    nominal = recording.run.nominal_load
    return settings.load.nominal.value if nominal is None else nominal


def _slope(track: Track, time: Array, half: float) -> Array:
    """Rate over the window: from the mean of its first half to that of its second."""
    return (track.mean(time, time + half) - track.mean(time - half, time)) / half


def _track(stamps: NDArray[np.int64], value: Array, origin: int) -> Track:
    time: Array = np.asarray((stamps - origin) * NS)
    areas = 0.5 * (value[1:] + value[:-1]) * np.diff(time)
    return Track(time, value, np.concatenate(([0.0], np.cumsum(areas))))


# ---- readings ------------------------------------------------------------------------------------
# ------------------

Stamped = tuple[NDArray[np.int64], Array]  # [ns], physical


def _raw(recording: Recording, settings: Settings) -> Mapping[str, Stamped]:
    """Calibrated readings of every channel that has at least two, in order of time, none twice."""
    found = {}
    for name, channel, field, factor in (
        ("wheel", "wheel_encoder", "count", 1.0),
        ("carriage", "carriage_encoder", "count", settings.pulley_radius),
        ("sinkage", "sinkage_pot", "volts", 1.0),
        ("current", "motor_shunt", "volts", 1.0),
    ):
        if channel in settings.channels:
            of = settings.channels[channel]
            found[name] = _physical(recording, channel, field, of.calibration, of.latency, factor)
    if settings.wrench is not None:
        wrench = settings.wrench
        for name, field, calibration in (
            ("drawbar_pull", "fx", wrench.drawbar_pull),
            ("load", "fz", wrench.load),
            ("torque", "ty", wrench.torque),
        ):
            found[name] = _physical(recording, "wrench", field, calibration, wrench.latency)
    return {name: stamped for name, stamped in found.items() if stamped[0].size > 1}


def _physical(
    recording: Recording,
    channel: str,
    field: str,
    calibration: Calibration,
    latency: float,
    factor: float = 1.0,
) -> Stamped:
    table = recording.arrays(f"/raw/{channel}")
    stamps, once = np.unique(table["stamp"] - round(latency / NS), return_index=True)
    raw = table[field][once].astype(float)
    good = np.isfinite(raw)
    return stamps[good], factor * (raw[good] * calibration.scale.value + calibration.offset.value)
