"""A recording taken at once gives what it gives tick by tick."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.estimator.config.settings import Rates
from gritd.estimator.messages.readings import CHANNELS, NS, Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.offline.batch import ESTIMATES, estimates
from gritd.estimator.offline.playback import recorded_ticks
from gritd.estimator.offline.run_window import window_ends
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import RecordedStreams, Stream
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import TICK_TOPIC
from gritd.estimator.wheel.sync import Sync
from tests.linear_plant import readings as plant
from tests.rig import CHANNELS as CHANNEL_SETTINGS
from tests.rig import SETTINGS, WRENCH, readings_of

MS = 1_000_000
START = 1_700_000_000 * NS
RIG = replace(
    SETTINGS,
    wrench=replace(WRENCH, latency=0.002),
    channels={
        **CHANNEL_SETTINGS,
        "motor_shunt": replace(CHANNEL_SETTINGS["motor_shunt"], latency=0.001),
        "motor_temperature": replace(
            CHANNEL_SETTINGS["sinkage_pot"],
            name="motor_temperature",
            low=-40.0,
            high=180.0,
            stale_after=0.2,
        ),
    },
)
TICK_ONLY = Flag.LATE_READINGS | Flag.COUNTER_JUMP
TRUTH = (720.0, 0.62, 0.025)
SCHEDULE = [(3.0, 70.0, 0.2), (3.0, 70.0, 0.4), (3.0, 100.0, 0.4), (1.0, 100.0, 1.0)]


def rough(rng, seconds=1.2):
    """Readings on a bad day: jitter, gaps, repeats, late ones, counter jumps, impossible values, a
    channel that is frozen or dithers, a counter that says anything for a while.
    """
    steady = readings_of(START, seconds=seconds, noise=True, seed=int(rng.integers(1 << 30)))
    steady += [
        Reading(
            START + k * 4 * MS,
            "wrench",
            tuple(rng.normal(20.0, 1.0, 6).tolist()),
            START + k * 4 * MS,
        )
        for k in range(round(seconds * 250))
    ]
    steady += [
        Reading(START + k * 90 * MS, "motor_temperature", 21.0 + 0.1 * k, START + k * 90 * MS)
        for k in range(12)
    ]
    gaps = {
        channel: int(rng.integers(0, seconds * NS)) for channel in CHANNELS if rng.random() < 0.4
    }
    jumps = {
        int(rng.integers(0, seconds * NS)): int(rng.integers(-(2**40), 2**40)) for _ in range(3)
    }
    freeze = int(rng.integers(0, seconds * NS))
    dither = float(rng.choice([0.0, 0.5e-3, 1.4e-3, 1.6e-3]))  # [V]; the noise is 2 mV
    wild = int(rng.integers(0, 2 * seconds * NS))  # in one run of two a counter is
    lasting = int(rng.integers(0, 300 * MS))
    absent = rng.random(6) < 0.1  # axes that the sensor does not have
    ices = int(rng.integers(0, 2 * seconds * NS))  # in one run of two the wrench does
    held = tuple(np.where(absent, np.nan, 20.0).tolist())
    found = []
    for reading in steady:
        since = reading.stamp - START
        if 0 < since - gaps.get(reading.channel, 1 << 62) < 200 * MS:
            continue
        if isinstance(reading.value, int):
            reading = reading._replace(
                value=reading.value + sum(j for at, j in jumps.items() if since > at)
            )
            if 0 < since - wild < lasting:
                reading = reading._replace(value=int(rng.integers(0, 2**16)))
        elif rng.random() < 0.01:
            bad = float(rng.choice([np.nan, np.inf, -1e9]))
            reading = reading._replace(value=(bad,) * 6 if reading.channel == "wrench" else bad)
        elif reading.channel == "wrench" and since > ices:
            reading = reading._replace(value=held)
        elif reading.channel == "wrench":
            axes = zip(reading.value, absent, strict=True)
            reading = reading._replace(
                value=tuple(float("nan") if none else value for value, none in axes)
            )
        elif reading.channel == "sinkage_pot" and since > freeze:
            reading = reading._replace(value=1.25 + dither * int(rng.integers(2)))
        stamp = reading.stamp + int(rng.integers(-MS, MS))
        delay = (
            int(rng.exponential(2 * MS)) if rng.random() < 0.95 else int(rng.integers(0, 90 * MS))
        )
        found.append(reading._replace(stamp=stamp, received=stamp + delay))
        if rng.random() < 0.05:
            found.append(found[-1]._replace(received=stamp + int(rng.integers(0, 80 * MS))))
    return sorted(found, key=lambda r: r.received)


def uneven_ticks(rng, seconds=1.2):
    """Ticks every 4 ms, now and then some missed."""
    steps = (
        4
        * MS
        * (
            1
            + (rng.random(round(seconds * 250)) < 0.05) * rng.integers(1, 30, round(seconds * 250))
        )
    )
    return (START + 3 * MS + np.cumsum(steps)).tolist()


def shared_out(found, ticks):
    """The readings each tick consumes, as a list of lists, and as `snapshots.RecordedStreams`."""
    consumed = np.searchsorted(ticks, [r.received for r in found])
    batches = [[] for _ in ticks]
    for tick, reading in zip(consumed, found, strict=True):
        if tick < len(ticks):
            batches[tick].append(reading)
    streams = {}
    for channel in CHANNELS:
        own = [(k, r) for k, batch in enumerate(batches) for r in batch if r.channel == channel]
        if own:
            columns = [(r.stamp, r.received, k, r.value) for k, r in own]
            streams[channel] = Stream(*(np.array(column) for column in zip(*columns, strict=True)))
    return batches, RecordedStreams(np.array(ticks), streams)


def flat(snapshot):
    return [v for field in snapshot for v in (field if isinstance(field, tuple) else (field,))]


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_snapshots_from_arrays_are_those_of_sync(seed):
    rng = np.random.default_rng(seed)
    ticks = uneven_ticks(rng)
    batches, whole = shared_out(rough(rng), ticks)
    sync, want = Sync(RIG), []
    for tick, batch in zip(ticks, batches, strict=True):
        for reading in batch:
            sync.push(reading)
        want.append(flat(sync.snapshot(tick)))
    have = [flat(snapshot) for snapshot in snapshots(RIG, whole, np.arange(len(ticks)))]
    np.testing.assert_allclose(have, want, rtol=1e-9, atol=1e-12)
    chosen = window_ends(whole.ticks, 100 * MS)
    assert np.array_equal(
        [flat(s) for s in snapshots(RIG, whole, chosen)], np.array(have)[chosen], equal_nan=True
    )


def test_a_recording_without_readings_has_no_windows():
    nothing = RecordedStreams(np.empty(0, np.int64), {})
    assert list(snapshots(RIG, nothing, np.empty(0, np.int64))) == []


def recorded(path, rig, with_ticks, rate=250):
    """A recording of the linear plant, as the daemon writes it or with raw topics only; and the
    ticks' records.
    """
    found = [r for _, batch in plant(rig, TRUTH, SCHEDULE, seed=3, rate=rate) for r in batch]
    writer = RunWriter(path, (TICK_TOPIC,), "", RunInfo(), compression="none")
    pipeline = Pipeline(rig, "plain")
    state, taken = pipeline.start(), 0
    for tick in range(found[0].received, found[-1].received + 4 * MS, 4 * MS):
        batch = [r for r in found[taken : taken + 50] if r.received <= tick]
        taken += len(batch)
        for reading in batch:
            writer.reading(reading)
        if with_ticks and tick % (100 * MS):  # some are missing
            state, record = pipeline.step(state, batch, tick)
            writer.message("/tick", tick, record)
    writer.close()
    return read(path)


def by_ticks(rig, recording):
    """Every tick of a recording as a structured array, by the pipeline."""
    pipeline = Pipeline(rig, "plain")
    state, rows = pipeline.start(), []
    for tick in recorded_ticks(recording, rig.rates.tick):
        state, record = pipeline.step(state, tick.readings, tick.stamp)
        rows.append(record)
    return np.array(
        rows, dtype=[(n, "<i8" if n in ("stamp", "evaluated") else "<f8") for n in TICK_NAMES]
    )


@pytest.mark.parametrize("with_ticks", [True, False])
@pytest.mark.parametrize("wrench", [WRENCH, None])
def test_estimates_are_those_of_the_ticks_at_window_ends(tmp_path, with_ticks, wrench):
    rig = replace(SETTINGS, wrench=wrench)
    recording = recorded(tmp_path / "run.mcap", rig, with_ticks)
    ticks = by_ticks(rig, recording)
    rows = estimates(rig, recording)
    assert rows.dtype.names == ESTIMATES and rows["updates"][-1] > 15
    at_ends = ticks[np.isin(ticks["evaluated"], rows["evaluated"])]
    assert len(at_ends) == len(rows)
    np.testing.assert_array_equal(at_ends["flags"].astype(int) & ~TICK_ONLY, rows["flags"])
    for name in ESTIMATES:
        if name != "flags":
            floor = 1e-10 if name.startswith("cov_") else 1e-12  # covariances are differences
            np.testing.assert_allclose(
                rows[name], at_ends[name], rtol=1e-9, atol=floor, err_msg=name
            )


def test_both_engines_take_a_recording_at_once(tmp_path):
    rig = replace(SETTINGS, wrench=WRENCH, rates=Rates())
    recording = recorded(tmp_path / "run.mcap", rig, with_ticks=False)
    plain, filterpy = estimates(rig, recording, "plain"), estimates(rig, recording, "filterpy")
    np.testing.assert_allclose(plain["cohesion"], filterpy["cohesion"], rtol=1e-9)
