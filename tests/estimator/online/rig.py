"""The shipped testbed at ten ticks a second, with the plain engine."""

from __future__ import annotations

from dataclasses import replace

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.config.settings import Rates
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline

TESTBED = load(packaged()).settings
SETTINGS = replace(
    TESTBED,
    rates=Rates(tick=10.0, update=10.0),
    filter=replace(TESTBED.filter, engine="plain"),
    channels={
        name: replace(channel, stale_after=1.0) for name, channel in TESTBED.channels.items()
    },
    wrench=replace(TESTBED.wrench, stale_after=1.0),
)


def last_tick(settings, readings):
    """The last tick of a run in ticks of 0.1 s."""
    pipeline = Pipeline(settings)
    state, t, batch, tick = pipeline.start(), readings[0].received + 100_000_000, [], ()
    for reading in readings:
        while reading.received > t:
            state, tick = pipeline.step(state, batch, t)
            batch, t = [], t + 100_000_000
        batch.append(reading)
    return dict(zip(TICK_NAMES, tick, strict=True))
