"""The plant's bed of strips beside Project Chrono's SCM terrain, on the motion that was recorded.
Nothing is fitted: soil and wheel are those of the recordings, the strips' recovery is a middling
one. Steady stretches only: 2 s after slip or speed changed, to the next change.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import World, responses
from gritd.tools.proof.blind.plant.scene import Felt, TrueMotion, TrueRig
from gritd.tools.proof.blind.plant.servo import Servo
from gritd.tools.proof.blind.plant.strips import StripBed

WEIGHTS = (31.3, 46.8, 78.6, 101.6, 30.9, 52.1)  # [N], runs 0-5
RIG = TrueRig(0.072, 0.071, 1.0, Servo(1.0, 1.0, 1.0), Servo(1.0, 1.0, 1.0), 0.01)
GROUND = PlantSoil(1000.0, float(np.tan(np.radians(30.0))), 0.025, 1.1, 1523400.0 + 900.0 / 0.071)
EVERY = 5  # of 250 Hz
SETTLED = 2.0  # [s] after a change


class Steady(NamedTuple):
    """Means over one steady stretch: slip, then sinkage [m], torque [N·m], pull [N] of each."""

    weight: float
    slip: float
    chrono: tuple[float, float, float]
    strips: tuple[float, float, float]
    paper: tuple[float, float, float]


def stretches(folder: Path) -> Iterator[Steady]:
    """All steady stretches of the reference campaign."""
    recorded = [_read(folder / f"base_{run}.csv.gz") for run in range(len(WEIGHTS))]
    motions = [_motion(*each) for each in zip(recorded, WEIGHTS, strict=True)]
    strips = responses([(World(RIG, GROUND, bed=StripBed()), motion) for motion in motions])
    paper = responses([(World(RIG, GROUND), motion) for motion in motions])

    for run, known in enumerate(recorded):
        reported = np.stack((known["z"], -known["T"], known["DP"]))
        for slip, inside in _steady(known):
            means = tuple(reported[:, inside].mean(axis=1).tolist())
            yield Steady(
                WEIGHTS[run], slip, means, _means(strips[run], inside), _means(paper[run], inside)
            )


def _read(path: Path) -> dict[str, Array]:
    table = np.genfromtxt(path, delimiter=",", names=True)[::EVERY]
    return {name: np.asarray(table[name], dtype=float) for name in table.dtype.names or ()}


def _motion(known: dict[str, Array], weight: float) -> TrueMotion:
    heavy = np.full(known["t"].size, weight)
    return TrueMotion(known["t"], known["angle"], known["omega"], known["x"], known["v"], heavy, 1)


def _steady(known: dict[str, Array]) -> Iterator[tuple[float, Array]]:
    """Slip and samples of each stretch of one slip and speed."""
    rim = RIG.radius * known["omega"]
    slip = np.round(1.0 - known["v"] / np.maximum(np.abs(rim), 1e-4), 2)
    changed = (np.abs(np.diff(rim, prepend=0.0)) > 1e-5) | (np.diff(slip, prepend=0.0) != 0.0)
    edges = [*np.flatnonzero(changed).tolist(), rim.size]
    for begin, end in pairwise(edges):
        inside = (known["t"] > known["t"][begin] + SETTLED) & (np.arange(rim.size) < end)
        if inside.sum() * EVERY > 250 and rim[begin] > 1e-3:
            yield float(slip[begin]), inside


def _means(felt: Felt, inside: Array) -> tuple[float, float, float]:
    sinkage, torque, pull = (
        float(values[inside].mean()) for values in (felt.sinkage, felt.torque, felt.pull)
    )
    return sinkage, torque, pull
