"""Campaigns as an engineer would drive them: runs of steady stretches at several loads, slips and
speeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any

import numpy as np

from gritd.tools.proof.blind.plant.axle import balance
from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim, reaction
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import Commanded
from gritd.tools.proof.blind.plant.scene import TrueRig

RATE = 250.0  # [Hz]
ANGLES = (0.35, 0.85)  # [rad] entry angles within which loads are chosen
SLIPS = (0.04, 0.6)
RAMP = (0.4, 1.0)  # [s]


@dataclass(frozen=True)
class DrivenStretch:
    duration: float  # [s]
    weight: float  # [N]; 0 lifts the wheel
    slip: float
    speed: float  # of the rim [m/s], negative backward, 0 at rest


@dataclass(frozen=True)
class BlindRun:
    stretches: tuple[DrivenStretch, ...]
    ramp: float  # [s]
    passes: int  # 1 on fresh soil
    start: float  # [m]
    begins: float  # [s] since the campaign began

    @property
    def duration(self) -> float:
        return sum(stretch.duration for stretch in self.stretches)

    @property
    def weight(self) -> float:
        return max(stretch.weight for stretch in self.stretches)


@dataclass(frozen=True)
class Design:
    """The design of a campaign: what the engineer does. None lets chance decide."""

    runs: int | None = None
    loads: int | None = None
    standstill: bool | None = None
    reversal: bool | None = None
    lifted: bool | None = None
    second_pass: bool | None = None
    speeds: bool | None = None
    wrench: bool | None = None
    staircase: bool | None = None  # the load changes within a run
    weighed: bool = False  # runs do not state their load, the wrench tells it


def design_drawn(rng: np.random.Generator, fixed: Design | None = None) -> Design:
    """A design by chance where it is not fixed."""
    fixed = fixed or Design()
    runs = int(rng.choice((1, 2, 3, 4, 5, 6), p=(0.1, 0.1, 0.25, 0.25, 0.15, 0.15)))

    drawn = {
        "runs": runs,
        "loads": 1 if rng.random() < 0.15 else 4,
        "standstill": bool(rng.random() < 0.7),
        "reversal": bool(rng.random() < 0.25),
        "lifted": bool(rng.random() < 0.15),
        "second_pass": bool(rng.random() < 0.25),
        "speeds": bool(rng.random() < 0.6),
        "wrench": bool(rng.random() < 0.7),
        "staircase": bool(rng.random() < 0.2),
    }
    chosen: dict[str, Any] = {
        name: value for name, value in drawn.items() if getattr(fixed, name) is None
    }

    design = replace(fixed, **chosen)
    staircase, lifted = design.staircase and design.wrench, design.lifted and design.wrench
    # nothing else tells that the load is off, or another
    weighed = design.weighed or bool(staircase)
    return replace(design, lifted=bool(lifted), staircase=bool(staircase), weighed=weighed)


def campaign(
    rig: TrueRig, ground: PlantSoil, design: Design, rng: np.random.Generator
) -> tuple[BlindRun, ...]:
    """Runs over soil that was prepared anew, but for second passes."""
    count = design.runs or 1
    most = (design.loads or 4) if design.staircase else min(count, design.loads or 4)
    weights = _weights(rig, ground, most, rng)
    runs: list[BlindRun] = []
    begins = 0.0

    for number in range(count):
        again = bool(design.second_pass) and number > 0 and rng.random() < 0.5
        weight = runs[-1].weight if again else weights[number % len(weights)]

        loads = [float(load) for load in rng.permutation(weights)] if design.staircase else [weight]
        run = _run(design, loads, rng)
        passes, start = (runs[-1].passes + 1, runs[-1].start) if again else (1, _start(rng))
        runs.append(replace(run, passes=passes, start=start, begins=begins))

        begins += run.duration + float(rng.uniform(60.0, 400.0))

    return tuple(runs)


def _start(rng: np.random.Generator) -> float:
    return 0.0 if rng.random() < 0.7 else round(float(rng.uniform(0.05, 0.3)), 2)


def _weights(rig: TrueRig, ground: PlantSoil, count: int, rng: np.random.Generator) -> list[float]:
    """Loads that sink the wheel to entry angles spread over ANGLES, in an order of chance [N]."""
    low, high = sorted(rng.uniform(*ANGLES, 2)) if count == 1 else ANGLES
    angles = np.linspace(low, high, count + 1)[:count] + rng.uniform(
        0.0, (high - low) / (count + 1), count
    )
    loads = reaction(
        ground, Rim(), rig.radius, rig.width, np.full(count, 0.8), np.asarray(angles)
    ).load
    rounded = [float(np.round(load, 1 if load < 20 else 0)) for load in loads]
    return [rounded[place] for place in rng.permutation(count)]


def _run(design: Design, loads: Sequence[float], rng: np.random.Generator) -> BlindRun:
    """loads: [N] of its stretches, in turn."""
    usual = float(rng.uniform(0.015, 0.04))
    slips = rng.permutation(np.linspace(*SLIPS, int(rng.integers(4, 7)))) + rng.uniform(-0.02, 0.02)
    stretches = [
        _stretch(load, float(slip), usual, design, rng)
        for slip, load in zip(slips, cycle(loads), strict=False)
    ]

    if design.reversal:
        stretches[-2:] = [
            replace(stretches[-2], duration=3.0),
            replace(stretches[-1], speed=-usual),
        ]
    if design.lifted:
        stretches.append(DrivenStretch(4.0, 0.0, 0.0, usual))
    if design.standstill:
        stretches.insert(0, DrivenStretch(float(rng.uniform(1.5, 3.0)), loads[0], 0.1, 0.0))

    ramp = float(rng.uniform(*RAMP))
    return BlindRun(tuple(stretches), ramp, 1, 0.0, 0.0)


def _stretch(
    weight: float, slip: float, usual: float, design: Design, rng: np.random.Generator
) -> DrivenStretch:
    speed = usual * float(rng.choice((0.4, 0.7, 1.0, 1.6))) if design.speeds else usual
    return DrivenStretch(float(rng.uniform(4.0, 6.0)), weight, round(slip, 3), round(speed, 4))


def orders(run: BlindRun, radius: float, rate: float = RATE) -> Commanded:
    """What the controllers are commanded, smooth between the stretches. `radius` [m] is the one
    that is configured.
    """
    time = np.arange(round(run.duration * rate)) / rate
    speed = _levels(run, time, [stretch.speed for stretch in run.stretches])
    slip = _levels(run, time, [stretch.slip for stretch in run.stretches])
    weight = _levels(run, time, [stretch.weight for stretch in run.stretches])
    travel = speed * np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + np.minimum(slip, 0.0)))
    return Commanded(run.begins + time, speed / radius, travel, weight, run.passes, run.start)


def _levels(run: BlindRun, time: Array, levels: list[float]) -> Array:
    """Levels joined by half cosines of the run's ramp, each at the end of its stretch."""
    values, edge = np.full(time.size, levels[0]), 0.0
    for before, after, stretch in zip(levels[:-1], levels[1:], run.stretches[:-1], strict=True):
        edge += stretch.duration
        share = np.clip((time - edge) / run.ramp + 1.0, 0.0, 1.0)
        values = values + (after - before) * 0.5 * (1.0 - np.cos(np.pi * share))
    return values


def deepest(rig: TrueRig, ground: PlantSoil, weight: float) -> float:
    """Entry angle [rad] at the largest slip."""
    at = np.array([1.0 - SLIPS[1]])

    def load_at(theta_1: Array) -> Array:
        return reaction(ground, Rim(), rig.radius, rig.width, at, theta_1).load

    return float(balance(load_at, np.array([weight]), np.array([0.6]))[0])


def with_weight(given: Commanded, weight: Array) -> Commanded:
    """The same orders under other weights (n,) [N]."""
    return replace(given, weight=weight)
