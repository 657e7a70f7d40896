"""The window is as short as the noise of slip allows, whatever the rates, live and from arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import Rates
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.offline.batch import followed
from gritd.estimator.offline.run_window import window_length
from gritd.estimator.offline.streams import streams_of
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.wheel.sync import PROBE
from tests.rig import COUNT, PULLEY_COUNT, SETTINGS

AUTO = replace(
    SETTINGS,
    rates=Rates(tick=50.0, auto=True),
    channels={n: replace(c, stale_after=1.0) for n, c in SETTINGS.channels.items()},
)
START = 1_700_000_000


def columns(rate, noise, seconds=12.0, still=2.0):
    """Times [s] and raw values of each channel; noise: of the encoders [counts]."""
    rng, time = np.random.default_rng(3), np.arange(0.0, seconds, 1.0 / rate)
    driven = np.maximum(time - still, 0.0)

    def counts(speed, step):
        return np.round(speed * driven / step + noise * rng.normal(size=time.size)).astype(int)

    volts = [centre + 2e-3 * rng.normal(size=time.size) for centre in (1.3, 0.85)]
    return {
        "wheel_encoder": (START + time, counts(0.4, COUNT)),
        "carriage_encoder": (START + time, counts(0.02 / 0.02, PULLEY_COUNT)),
        "sinkage_pot": (START + time, volts[0]),
        "motor_shunt": (START + time, volts[1]),
    }


def streams(rate, noise):
    raw = {}
    for channel, (time, values) in columns(rate, noise).items():
        name = "count" if channel.endswith("encoder") else "volts"
        kind = "i8" if name == "count" else "f8"
        rows = np.empty(time.size, [("log_time", "i8"), ("stamp", "i8"), (name, kind)])
        rows["log_time"] = rows["stamp"] = np.round(time * NS).astype(np.int64)
        rows[name] = values
        raw[channel] = rows
    return streams_of(raw, AUTO.rates.tick)


def test_more_noise_and_fewer_readings_ask_for_a_longer_window():
    lengths = {
        (rate, noise): window_length(AUTO, streams(rate, noise)) / NS
        for rate in (20.0, 200.0)
        for noise in (0.3, 30.0)
    }
    assert lengths[200.0, 0.3] == pytest.approx(0.1)
    assert lengths[200.0, 30.0] > lengths[200.0, 0.3]
    assert lengths[20.0, 30.0] > lengths[200.0, 30.0]
    assert lengths[20.0, 0.3] >= 5 / 20.0 - 0.06  # five readings


def test_the_noise_that_the_readings_show_counts_and_not_only_the_stated_one():
    stated = SETTINGS.channels["carriage_encoder"].noise
    assert stated < 1.0
    assert window_length(AUTO, streams(50.0, 30.0)) > window_length(AUTO, streams(50.0, stated))


def test_a_run_that_never_drives_keeps_the_first_windows_and_updates_nothing():
    still = {name: (time, np.zeros_like(values)) for name, (time, values) in
             columns(50.0, 0.0).items()}  # fmt: skip
    raw = {}
    for channel, (time, values) in still.items():
        name = "count" if channel.endswith("encoder") else "volts"
        rows = np.empty(time.size, [("log_time", "i8"), ("stamp", "i8"), (name, "f8")])
        rows["log_time"] = rows["stamp"] = np.round(time * NS).astype(np.int64)
        rows[name] = values
        raw[channel] = rows
    recorded = streams_of(raw, AUTO.rates.tick)
    assert window_length(AUTO, recorded) == PROBE
    made = followed(AUTO, recorded)
    assert not made.believed and "never updated" in made.reason.why


@pytest.mark.parametrize("rate, noise", [(50.0, 0.3), (200.0, 30.0)])
def test_live_and_from_arrays_it_is_the_same_choice(rate, noise):
    recorded = streams(rate, noise)
    pipeline = Pipeline(AUTO)
    state = pipeline.start()
    readings = sorted(_readings(recorded), key=lambda reading: reading.received)
    at = 0
    for tick in recorded.ticks.tolist():
        batch = []
        while at < len(readings) and readings[at].received <= tick:
            batch.append(readings[at])
            at += 1
        state, _ = pipeline.step(state, batch, tick)
    assert not state.track.choosing
    assert state.track.window == window_length(AUTO, recorded)


def _readings(recorded):
    for channel, stream in recorded.streams.items():
        for stamp, value in zip(stream.stamp.tolist(), stream.values.tolist(), strict=True):
            yield Reading(stamp, channel, value, stamp)
