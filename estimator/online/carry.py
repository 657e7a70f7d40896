"""A new configuration for a run that goes on: what may change, and what the state becomes.

Calibration, noise, soil, load, effects and filter may change between two ticks. Devices, signals
and rates belong to threads and buffers that already run: they need a restart.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bank import reported
from gritd.estimator.filter.estimate import STATES
from gritd.estimator.filter.segments import Memory
from gritd.estimator.filter.track import TrackState
from gritd.estimator.online.pipeline import Pipeline, State

_FIXED = ("testbed", "wheel", "pulley_radius", "devices", "rates", "place")
# of a channel: the reader's decoder was built with them
_WIRING = ("device", "signal", "bits", "low", "high")
_WRENCH_WIRING = ("device", "signal", "max_force", "max_torque")


def needs_restart(old: Settings, new: Settings) -> str:
    """The first key whose change a running daemon cannot take over; '' if there is none."""
    return next(_changed(old, new), "")


def _changed(old: Settings, new: Settings) -> Iterator[str]:
    yield from _differing("", old, new, _FIXED)
    if old.channels.keys() != new.channels.keys() or (old.wrench is None) != (new.wrench is None):
        yield "channels"
    for name in old.channels.keys() & new.channels.keys():
        yield from _differing(f"channels.{name}.", old.channels[name], new.channels[name], _WIRING)
    if old.wrench and new.wrench:
        yield from _differing("channels.wrench.", old.wrench, new.wrench, _WRENCH_WIRING)
    yield from _differing(
        "logging.", old.logging, new.logging, [field.name for field in fields(old.logging)]
    )


def _differing(path: str, old: object, new: object, names: Iterable[str]) -> Iterator[str]:
    yield from (path + name for name in names if getattr(old, name) != getattr(new, name))


def carry_over(pipeline: Pipeline, state: State, before: Settings) -> State:
    """The state of `before` for the pipeline that takes over.

    The windows begin empty: what stands in them was read with another calibration. The estimate is
    kept where the soil section is the same, with the prior's uncertainty, because what made it
    certain was read with the old configuration; a new soil section is a new prior. Counters, time,
    the encoders' baselines, the place where the run began and what effects remember go on.
    """
    fresh = pipeline.start()
    fresh.sync.continued(state.sync)
    old = state.track
    recall = {name: old.recall.get(name, value) for name, value in fresh.track.recall.items()}
    origin = None if old.origin is None else _read_anew(old.origin, before, pipeline.settings)
    track = fresh.track._replace(
        window=old.window,
        choosing=old.choosing,
        updates=old.updates,
        resets=old.resets,
        resets_flagged=old.resets,
        began=old.began,
        recall=recall,
        origin=origin,
    )
    if pipeline.settings.soil == before.soil:
        track = _kept(track, state.track)

    return replace(
        fresh, track=track, pull=state.pull, first=state.first, late=state.late, jumps=state.jumps
    )


def _read_anew(position: float, before: Settings, now: Settings) -> float:
    """A place of the carriage [m] by another calibration of its encoder."""
    old, new = (settings.channels["carriage_encoder"].calibration for settings in (before, now))
    count = (position / before.pulley_radius - old.offset.value) / old.scale.value
    return (count * new.scale.value + new.offset.value) * now.pulley_radius


def _kept(track: TrackState, old: TrackState) -> TrackState:
    """The soil as it was estimated, as uncertain as the prior."""
    soil = old.estimate.x[:STATES]
    bank = tuple([member._replace(x=(*soil, *member.x[STATES:])) for member in track.bank])
    return track._replace(estimate=reported(bank), base=bank, bank=bank, memory=Memory(bank))
