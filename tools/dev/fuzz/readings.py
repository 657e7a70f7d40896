"""Readings of any value, stamp and order, through the filter."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import ENGINES, Settings
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline, State
from gritd.tools.dev.fuzz.case import START, Case

ESTIMATE = [TICK_NAMES.index(name) for name in ("cohesion", "tan_phi", "shear_modulus")]
SIGMAS = [TICK_NAMES.index(f"{name}_sigma") for name in ("cohesion", "tan_phi", "shear_modulus")]
WILD = (0.0, -0.0, 1e-300, 1e300, -1e300, math.inf, -math.inf, math.nan, 1e-9, 5.0, -5.0)


def wild_inputs(_: Path) -> Case:
    """Twelve ticks of anything: values, stamps, orders, gaps. Estimates stay finite, sure of
    nothing false, in bounds. The engines take turns.

    One run in four goes on from the one before, so that the filter is met in every state it can be
    brought into.
    """
    settings = quick(config.load(packaged()).settings)
    pipelines = cycle(Pipeline(settings, engine) for engine in ENGINES)
    running: list[tuple[State, int]] = []

    def case(rng: random.Random) -> str:
        pipeline = next(pipelines)
        state, t = running.pop() if running and rng.random() < 0.25 else (pipeline.start(), START)
        sane = rng.random() < 0.7  # mostly plausible with wild ones in between: those get furthest
        for number in range(12):
            t += (
                rng.choice((0, 1, NS // 10, NS // 10, NS // 10, NS, 100 * NS))
                if rng.random() < 0.2
                else NS // 10
            )

            state, record = pipeline.step(state, wild_readings(rng, t, number, sane), t)
            if wrong := unfit(record, state, settings):
                return f"tick {number}: {wrong}"

        running[:] = [(state, t)]
        return ""

    return case


def quick(settings: Settings) -> Settings:
    """Ten ticks a second, so that every one of them is an update."""
    return replace(settings, rates=replace(settings.rates, tick=20.0))


def wild_readings(rng: random.Random, t: int, number: int, sane: bool) -> list[Reading]:
    """A window of readings of all channels; plausible ones, or anything."""
    readings = []
    for place in range(5):
        stamp = t - NS // 20 - place * NS // 50

        plain: dict[str, int | float | tuple[float, ...]] = {
            "wheel_encoder": number * 313 - place * 62,
            "carriage_encoder": number * 16 - place * 3,
            "sinkage_pot": 1.3 + rng.gauss(0, 2e-3),
            "motor_shunt": 3.2 + rng.gauss(0, 2e-3),
            "wrench": (10.0, 0.0, 70.0 + rng.gauss(0, 0.3), 0.0, 2.0, 0.0),
            "motor_temperature": 20.0,
        }

        for channel, value in plain.items():
            wild = rng.random() < (0.02 if sane else 0.6)
            readings.append(
                Reading(
                    wild_stamp(rng, stamp, wild),
                    channel,
                    wild_value(rng, value) if wild else value,
                    t,
                )
            )

    rng.shuffle(readings)
    return readings


def wild_stamp(rng: random.Random, stamp: int, wild: bool) -> int:
    return (
        stamp + rng.choice((0, 0, 1, -NS, NS, rng.randrange(-(10**18), 10**18))) if wild else stamp
    )


def wild_value(
    rng: random.Random, value: int | float | tuple[float, ...]
) -> int | float | tuple[float, ...]:
    if isinstance(value, tuple):
        return tuple(rng.choice((*WILD, float(part), rng.gauss(0, 100))) for part in value)
    if isinstance(value, int):
        return rng.choice((0, value + 1, -(2**62), 2**62, rng.randrange(-(2**40), 2**40)))
    return rng.choice((*WILD, rng.gauss(0, 10)))


def unfit(record: Sequence[float], state: State, settings: Settings) -> str:
    """What is wrong with a tick: a non-finite estimate, one out of bounds, a covariance that is
    none.
    """
    if not all(math.isfinite(record[place]) for place in (*ESTIMATE, *SIGMAS)):
        return f"not finite: {[record[place] for place in (*ESTIMATE, *SIGMAS)]}"

    bounds = settings.filter
    limits = (bounds.cohesion_bounds, bounds.tan_phi_bounds, bounds.shear_modulus_bounds)
    for place, (low, high) in zip(ESTIMATE, limits, strict=True):
        if not low * (1 - 1e-9) <= record[place] <= high * (1 + 1e-9):
            return f"{TICK_NAMES[place]} is {record[place]}, outside [{low}, {high}]"

    covariance = np.array(state.track.estimate.P)
    if not np.array_equal(covariance, covariance.T):
        return "covariance not symmetric"

    lowest = float(np.linalg.eigvalsh(covariance)[0])
    return "" if lowest > 0.0 else f"covariance not positive definite: {lowest}"
