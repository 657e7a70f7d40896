"""A rig whose filter starts from a constant soil, and a run of it on the linear plant."""

from __future__ import annotations

from dataclasses import replace

from gritd.estimator.config.settings import Rates
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from tests.linear_plant import readings
from tests.rig import CHANNELS, SETTINGS, WRENCH

CONSTANT_SOIL = replace(SETTINGS.filter, cohesion_walk=0.0, tan_phi_walk=0.0, ln_k_walk=0.0)
SLOW = {name: replace(channel, stale_after=0.5) for name, channel in CHANNELS.items()}
RIG = replace(
    SETTINGS,
    wrench=replace(WRENCH, stale_after=0.5),
    filter=CONSTANT_SOIL,
    rates=Rates(tick=10.0, update=10.0),
    channels=SLOW,
)
TRUTH = (720.0, 0.62, 0.025)


def run(settings, truth, schedule, seed=0, engine="plain", plant=None):
    """The last state, and the ticks as dictionaries; plant: the true rig, where it is another."""
    pipeline = Pipeline(settings, engine)
    state, ticks = pipeline.start(), []
    for t, batch in readings(plant or settings, truth, schedule, seed=seed):
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    return state.track, ticks
