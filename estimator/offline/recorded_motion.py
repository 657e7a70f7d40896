"""How a recording was driven: its motion on an even time grid, as input of the forward model.

The windows are those of the on-line filter (snapshots.py), one a tick. Where a window is empty or
holds no slope, the motion is taken to go on evenly.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.messages.readings import ENCODERS, NS
from gritd.estimator.offline.run_window import window_length
from gritd.estimator.offline.snapshots import Series, View
from gritd.estimator.offline.streams import RecordedStreams, streams_at
from gritd.estimator.offline.windows import Bools
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.stages.history import rate_of
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array

AT_ONCE = 20_000  # windows looked at together: bounds the memory, about 30 MB


def recorded_motion(recording: Recording, settings: Settings, rate: float) -> Motion:
    """Arrays (n,) at `rate` [Hz]; time [s] runs from where both encoders began.

    The load is the wrench's where there is one, else the run's nominal load, else the configured
    one. Raises RecordingError where an encoder is missing or never known together with the other.
    """
    settings = settings_of_run(settings, recording.run)
    for name in ENCODERS:
        if not recording.counts[f"/raw/{name}"]:
            raise RecordingError(f"{recording.path}: /raw/{name}: no readings; expected an encoder")

    time, columns, known = _windows(settings, streams_at(recording, rate))
    if np.count_nonzero(known) < 2:
        raise RecordingError(
            f"{recording.path}: channels overlap for less than a window; expected more"
        )

    inside = slice(np.flatnonzero(known)[0], np.flatnonzero(known)[-1] + 1)
    angle, speed, position, travel, load = (
        np.interp(time[inside], time[known], column[known]) for column in columns
    )
    time = time[inside]
    return Motion(
        time=time,
        wheel_angle=angle,
        wheel_speed=speed,
        carriage_position=position - position[0],
        carriage_speed=travel,
        load=load,
        pass_number=float(recording.run.pass_number),
        start_position=recording.run.start_position,
        wheel_acceleration=rate_of(time, speed),
    )


def _windows(settings: Settings, recorded: RecordedStreams) -> tuple[Array, Array, Bools]:
    """Centre of every tick's window (n,) [s], the five columns of the motion (5, n), and where all
    of them are known (n,).
    """
    parts = list(_parts(settings, recorded, window_length(settings, recorded)))
    if not parts:
        return np.zeros(0), np.zeros((5, 0)), np.zeros(0, bool)
    time, columns, known = zip(*parts, strict=True)
    return np.concatenate(time), np.concatenate(columns, axis=1), np.concatenate(known)


def _parts(
    settings: Settings, recorded: RecordedStreams, length: int
) -> Iterator[tuple[Array, Array, Bools]]:
    began = max(int(recorded.streams[name].stamp.min()) for name in ENCODERS)
    for start in range(0, len(recorded.ticks), AT_ONCE):
        ticks = np.arange(start, min(start + AT_ONCE, len(recorded.ticks)))
        view = View(settings, recorded, ticks, length)
        wheel = view.slope("wheel_encoder", 1.0)
        carriage = view.slope("carriage_encoder", settings.pulley_radius)
        load = _load(settings, recorded, view)

        centre = (view.ends - view.length // 2 - began) / NS
        columns = (wheel.position, wheel.value, carriage.position, carriage.value, load.value)
        known = wheel.known & carriage.known & load.known & (view.ends - view.length >= began)
        yield centre, np.array(columns), known


def _load(settings: Settings, recorded: RecordedStreams, view: View) -> Series:
    """W of every window: measured where there is a sensor, else the nominal one."""
    if settings.wrench is not None and "wrench" in recorded.streams:
        return view.wrench()[0]
    nominal = np.full(view.ends.shape, settings.load.nominal.value)
    return Series(nominal, 0.0 * nominal, nominal == nominal, view.ends)
