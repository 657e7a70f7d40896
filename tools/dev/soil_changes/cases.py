"""Runs over a soil that changes: drawn soil, calibration errors, loads, slips and change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import NS
from gritd.estimator.offline.run_window import window_ends
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import RecordedStreams, Stream
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.estimator.wheel.sync import Snapshot
from gritd.tools.testbed import plant
from gritd.tools.testbed.drawn_rig import drawn, drawn_rig
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.sensors import START, TRANSPORT, Sent, sent
from gritd.tools.testbed.simulation import soil_of

Kind = Literal["step", "ramp", "patch", "none"]
KINDS: tuple[Kind, ...] = ("step", "ramp", "patch")

RATE = 250.0  # [Hz] readings of every channel
BEFORE, AFTER = 60.0, 70.0  # [s] of driving before a change begins, at the least, and after
UNCHANGED = 600.0  # [s] of a run without a change
RAMP = 20.0  # [s]
EDGE = 0.01  # [m] of a patch
C_CHANGE, TAN_PHI_CHANGE = 0.20, 0.06  # largest, relative


@dataclass(frozen=True)
class SoilChangeCase:
    """One run: the true soil over time, the windows the sensors give, and when the soil changes."""

    kind: Kind
    varied: bool  # whether the load varies
    settings: Settings  # of the filter
    snapshots: list[Snapshot]
    cohesion: Array  # true [Pa], one a window
    tan_phi: Array  # true, one a window
    begins: float  # [s] of the change
    settled: float  # [s] from which on the soil is the same again


def packaged_rig() -> Settings:
    """The packaged testbed at ten ticks a second."""
    settings = config.load(packaged()).settings
    assert settings.wrench is not None
    channels = {name: replace(each, stale_after=1.0) for name, each in settings.channels.items()}

    return replace(
        settings,
        channels=channels,
        wrench=replace(settings.wrench, stale_after=1.0),
        rates=replace(settings.rates, tick=settings.rates.update),
        filter=replace(settings.filter, engine="plain"),
    )


def case(
    settings: Settings, kind: Kind, seed: int, of: plant.PlantKind = "original", rate: float = RATE
) -> SoilChangeCase:
    """The case of a seed: the load varies in every other one, a quarter has no force/torque
    sensor.
    """
    rng = np.random.default_rng((seed, ["step", "ramp", "patch", "none"].index(kind)))
    varied = seed % 2 == 0
    if seed % 4 == 1:
        settings = replace(settings, wrench=None)
    seconds = UNCHANGED if kind == "none" else BEFORE + 10.0 + AFTER

    motion = motion_of(_schedule(rng, seconds, varied), settings.wheel.radius, rate)
    begins = BEFORE + rng.uniform(0.0, 10.0)
    share, settled = _change(kind, motion, begins, rng)
    soil = _changed(_soil(settings, rng), share, rng)
    if of == "linear":
        settings = replace(settings, effects=())

    rig, driven = drawn_rig(settings, rng), motion
    if settings.wrench is None:
        settings, driven = _weighed(settings, motion, rng)
    response = plant.respond(of, settings, soil, driven)
    seen = _windows(settings, sent(rig, driven, response, rng))

    at = (np.array([snapshot.evaluated for snapshot in seen]) - START) / NS
    time = np.asarray(motion.time)
    c, tan_phi = (np.interp(at, time, values) for values in (soil.cohesion, soil.tan_phi))
    return SoilChangeCase(kind, varied, settings, seen, c, tan_phi, begins, settled)


def _weighed(
    settings: Settings, motion: Motion, rng: np.random.Generator
) -> tuple[Settings, Motion]:
    """Without a force/torque sensor: the load is what the weights say, and off by its sigma."""
    load = replace(settings.load.nominal, value=float(np.asarray(motion.load)[0]))
    stated = replace(settings, load=replace(settings.load, nominal=load))
    return stated, replace(motion, load=motion.load + drawn(load, rng).value - load.value)


def _schedule(rng: np.random.Generator, seconds: float, varied: bool) -> Schedule:
    """Conditions of 3 to 8 s; one load or several, slips from 3 to 60 %."""
    load, segments, left = rng.uniform(35.0, 100.0), [Segment(1.5, 60.0, 0.2, 0.0)], seconds
    while left > 0.0:
        duration = rng.uniform(3.0, 8.0)
        load = rng.uniform(35.0, 100.0) if varied else load
        slip, speed = rng.uniform(0.03, 0.6), rng.uniform(0.018, 0.03)
        segments.append(Segment(duration, load, slip, speed))
        left -= duration
    segments[0] = replace(segments[0], load=segments[1].load)
    return Schedule(tuple(segments), plant.RAMP)


def _soil(settings: Settings, rng: np.random.Generator) -> Soil:
    """A soil drawn from the stated prior."""
    c, tan_phi, k = settings.soil.cohesion, settings.soil.tan_phi, settings.soil.shear_modulus
    values = {
        "cohesion": max(drawn(c, rng).value, 0.1 * c.value),
        "tan_phi": drawn(tan_phi, rng).value,
        "shear_modulus": max(drawn(k, rng).value, 0.5 * k.value),
    }
    return soil_of(settings, values)


def _change(
    kind: Kind, motion: Motion, begins: float, rng: np.random.Generator
) -> tuple[Array, float]:
    """How much of the change the wheel feels at every sample, 0 to 1, and when the last of it is
    over [s].
    """
    time, place = np.asarray(motion.time), np.asarray(motion.carriage_position)

    if kind == "none":
        return np.zeros(time.size), float(time[-1])
    if kind == "step":
        return np.where(time >= begins, 1.0, 0.0), begins
    if kind == "ramp":
        return np.clip((time - begins) / RAMP, 0.0, 1.0), begins + RAMP

    start = float(np.interp(begins, time, place))
    end = start + rng.uniform(0.15, 0.5)
    share = 0.5 * (np.tanh((place - start) / EDGE) - np.tanh((place - end) / EDGE))
    return share, float(np.interp(end, place, time))


def _changed(soil: Soil, share: Array, rng: np.random.Generator) -> Soil:
    c = soil.cohesion * (1.0 + rng.uniform(-C_CHANGE, C_CHANGE) * share)
    tan_phi = soil.tan_phi * (1.0 + rng.uniform(-TAN_PHI_CHANGE, TAN_PHI_CHANGE) * share)
    return replace(soil, cohesion=c, tan_phi=tan_phi)


def _windows(settings: Settings, channels: Mapping[str, Sent]) -> list[Snapshot]:
    """What the loop's windows see of what the channels send."""
    last = min(int(each.stamps[-1]) for each in channels.values())
    ticks = np.arange(START, last, round(NS / settings.rates.tick))

    streams = {
        name: Stream(
            each.stamps,
            each.stamps + TRANSPORT,
            np.searchsorted(ticks, each.stamps + TRANSPORT),
            each.values,
        )
        for name, each in channels.items()
    }

    ends = window_ends(ticks, round(NS / settings.rates.update))
    return list(snapshots(settings, RecordedStreams(ticks, streams), ends))
