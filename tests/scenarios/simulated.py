"""Simulated readings through the pipeline, without a daemon."""

from __future__ import annotations

import numpy as np

from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.topics import TICK_TOPIC
from tests.scenarios.rig import TESTBED

SETTINGS = TESTBED.settings
START = 1_700_000_000_000_000_000
TICK = 4_000_000  # [ns]
PIPELINE = "pipeline, readings simulated"
DRIVERS = "drivers' decoders and pipeline, bytes simulated"


def shifted(readings):
    return [r._replace(stamp=r.stamp + START, received=r.received + START) for r in readings]


def ticks_of(readings, settings=SETTINGS, seconds=None, encoded=False):
    """Every tick over readings in order of arrival, as a structured array, or as the bytes that
    are logged.
    """
    pipeline = Pipeline(settings, "plain")
    state, records, due = pipeline.start(), [], 0
    end = max(r.received for r in readings)
    for t in range(START + TICK, end, TICK):
        batch = []
        while due < len(readings) and readings[due].received <= t:
            batch.append(readings[due])
            due += 1
        state, record = pipeline.step(state, batch, t)
        records.append(record)
    if encoded:
        return [TICK_TOPIC.codec.encode(record) for record in records]
    return {name: np.array([record[i] for record in records]) for i, name in enumerate(TICK_NAMES)}
