"""Small campaigns for the tests of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Soil
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import RATE, Plan, record
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import soil_of

LOADS = (40.0, 70.0, 100.0)  # [N]
SLIPS = (0.05, 0.2, 0.45)


@cache
def settings() -> Settings:
    return replace(config.load(packaged()).settings, effects=())


def plan(
    loads: Sequence[float] = LOADS,
    seconds: float = 16.0,
    standstill: bool = True,
    wrench: bool = True,
    slow: float = 0.0,
    slow_time: float = 1.0,
    noise: float = 1.0,
    seed: int = 1,
    reverse: bool = False,
    stop: bool = False,
    speeds: Sequence[float] = (0.015, 0.03, 0.022),
    pace: float = 1.0,
) -> Plan:
    """One run a load; three slips and speeds each, in another order each run."""
    motions = []
    for number, load in enumerate(loads):
        order = np.roll(SLIPS, number)
        each = seconds / len(order)
        rest = [Segment(2.0, load, 0.2, 0.0)] if standstill else []
        paces = pace * np.roll(speeds, number // 2)
        driven = [
            Segment(each, load, float(s), float(v)) for s, v in zip(order, paces, strict=True)
        ]
        back = [Segment(each, load, 0.2, -0.02)] if reverse else []
        end = [Segment(1.5, load, 0.2, 0.0)] if stop else []
        motion = motion_of(
            Schedule((*rest, *driven, *back, *end), 0.5), settings().wheel.radius, RATE
        )
        motions.append(replace(motion, time=np.asarray(motion.time) + 40.0 * number))
    return Plan(
        settings(),
        soil(),
        tuple(motions),
        tuple(loads),
        noise,
        slow,
        slow_time,
        wrench,
        {},
        (0.0,) * len(loads),
        seed,
    )


def soil() -> Soil:
    """Off the configured one by half a sigma and more."""
    return soil_of(
        settings(),
        {"cohesion": 1180.0, "tan_phi": 0.553, "shear_modulus": 0.0262, "modulus_factor": 1.02},
    )


def diagnosed(drawn: Plan, acting: Sequence[Effect] = ()) -> Diagnosis:
    return diagnose(wheel_rig(record(drawn, acting), drawn.settings))


def group(found: Diagnosis) -> set[str]:
    """The first name and those it cannot be distinguished from."""
    first = found.hypotheses[0]
    return {first.effect, *first.indistinguishable_from}
