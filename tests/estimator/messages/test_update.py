"""/update: one message for each filter update, with what /tick says of it."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest

from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.messages.update import UPDATE_NAMES, update_of
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.topics import messages_of
from tests.linear_plant import readings
from tests.rig import SETTINGS


@pytest.fixture(scope="module")
def ticks():
    pipeline = Pipeline(SETTINGS)
    state, rows = pipeline.start(), []
    sent = readings(SETTINGS, (900.0, 0.6, 0.02), [(5.0, 60.0, 0.2)], seed=1, rate=250)
    for _, batch in sent:
        for stamp, group in groupby(batch, key=lambda reading: reading.stamp):
            state, row = pipeline.step(state, list(group), stamp)
            rows.append(row)
    return rows


def test_updates_are_the_ticks_at_which_the_filter_was_offered_a_measurement(ticks):
    updates = [update_of(tick) for tick in ticks]
    made = [update is not None for update in updates]
    offered = [tick[TICK_NAMES.index("torque_s")] > 0.0 for tick in ticks]
    assert made == offered and 10 < sum(made) < len(ticks) / 10


def test_an_update_says_what_its_tick_says(ticks):
    for tick in ticks:
        update = update_of(tick)
        if update is None:
            assert [topic for topic, *_ in messages_of(tick)] == ["/tick"]
            continue
        said, named = (
            dict(zip(UPDATE_NAMES, update, strict=True)),
            dict(zip(TICK_NAMES, tick, strict=True)),
        )
        for name in set(UPDATE_NAMES) & set(TICK_NAMES):
            assert repr(said[name]) == repr(named[name]), name
        z = named["torque_innovation"] / np.sqrt(named["torque_s"])
        assert said["torque_sigmas"] == pytest.approx(z)
        assert [topic for topic, *_ in messages_of(tick)] == ["/tick", "/update"]
