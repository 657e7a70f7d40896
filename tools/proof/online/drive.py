"""A bench driven by the independent plant: the columns of its tables, with noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gritd.tools.proof.blind.plant.bed import EquationBed
from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim
from gritd.tools.proof.blind.plant.effect import PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import World, responses
from gritd.tools.proof.blind.plant.scene import Felt, Scene, TrueMotion, TrueRig
from gritd.tools.proof.blind.plant.servo import Servo, summed
from gritd.tools.proof.online.draw import Bench, DrawnRun, SoilChange

STILL, CHANGING = 1.0, 0.8  # [s] before a run begins to move; between two stretches
FINEST = 100.0  # [Hz] at which the plant is solved at least


@dataclass(frozen=True)
class Peak(PlantEffect):
    """θₘ/θ₁ = c₁ + c₂ i, Eq. (5)."""

    c1: float = 0.5
    c2: float = 0.0

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, peak=self.c1 + self.c2 * np.maximum(scene.slip, 0.0))


@dataclass(frozen=True)
class Changing(PlantEffect):
    """c and tan φ along the course of a run."""

    course: SoilChange | None = None

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        course = self.course
        if course is None:
            return ground
        done = share(course, scene.motion.time)
        return replace(
            ground,
            cohesion=ground.cohesion * (1.0 + (course.cohesion - 1.0) * done),
            tan_phi=ground.tan_phi * (1.0 + (course.tan_phi - 1.0) * done),
        )


def share(course: SoilChange, time: Array) -> Array:
    """How much of the change is there (n,), 0 … 1."""
    if course.kind == "ramp":
        return np.clip((time - course.begin) / (course.end - course.begin), 0.0, 1.0)
    after = time >= course.begin
    return (after if course.kind == "step" else after & (time < course.end)).astype(float)


class SimulatedTable(NamedTuple):
    """One table, arrays (n,), SI; noise included."""

    time: Array
    angle: Array
    travel: Array
    sinkage: Array
    pull: Array
    load: Array
    torque: Array


def driven(bench: Bench) -> list[SimulatedTable]:
    """The tables of all runs."""
    rng = np.random.default_rng((bench.seed, 77))
    felt = responses(
        [(_world(bench, run), _motion(bench, run)) for run in bench.runs], damped=False
    )
    return [_read(bench, one, number, rng) for number, one in enumerate(felt)]


def _world(bench: Bench, run: DrawnRun) -> World:
    idle = Servo(1.0, 1.0, 1.0)
    rig = TrueRig(bench.radius, bench.width, 1.0, idle, idle, 0.01)
    effects = (Peak(1.0, bench.c1, bench.c2), Changing(1.0, run.course))
    return World(rig, bench.ground, effects, EquationBed())


def _motion(bench: Bench, run: DrawnRun) -> TrueMotion:
    """The carriage keeps its speed; the wheel turns faster by the slip that is ordered."""
    rate = bench.rate * max(1, round(FINEST / bench.rate))
    time = np.arange(round(run.duration * rate)) / rate
    begun = np.clip((time - STILL) / CHANGING, 0.0, 1.0)
    moving = 0.5 * (1.0 - np.cos(np.pi * begun))

    slip = _levels(run, time, [part.slip for part in run.parts])
    load = _levels(run, time, [part.load for part in run.parts])
    speed = bench.speed * moving
    omega = speed / (1.0 - slip) / bench.radius
    step = 1.0 / rate
    return TrueMotion(time, summed(omega, step), omega, summed(speed, step), speed, load, 1)


def _levels(run: DrawnRun, time: Array, levels: list[float]) -> Array:
    values, edge = np.full(time.size, levels[0]), 0.0
    for before, after, part in zip(levels[:-1], levels[1:], run.parts[:-1], strict=True):
        edge += part.duration
        done = np.clip((time - edge) / CHANGING, 0.0, 1.0)
        values = values + (after - before) * 0.5 * (1.0 - np.cos(np.pi * done))
    return values


def _read(bench: Bench, felt: Felt, number: int, rng: np.random.Generator) -> SimulatedTable:
    motion = felt.scene.motion
    every = round(1.0 / (motion.step * bench.rate))
    pull, load, torque = (
        _lagged(values, bench.lag, motion.step) for values in (felt.pull, felt.load, felt.torque)
    )

    if bench.stratum == "friction":
        torque = torque + bench.left_out * felt.scene.moving
    if bench.stratum == "wall":
        pull = pull - bench.left_out * load * felt.scene.moving
    if bench.stratum == "creep":  # over the whole campaign
        length = sum([run.duration for run in bench.runs])
        begun = sum([run.duration for run in bench.runs[:number]])
        heaviest = max(part.load for run in bench.runs for part in run.parts)
        load = load + bench.left_out * heaviest * (begun + motion.time) / length

    noise = bench.noise
    columns = (
        (motion.time, 0.0),
        (motion.turn, noise.angle),
        (motion.travel, noise.travel),
        (felt.sinkage, noise.sinkage),
        (pull, noise.force),
        (load, noise.force),
        (torque, noise.torque),
    )
    return SimulatedTable(
        *[
            values[::every] + sigma * rng.standard_normal(values[::every].size)
            for values, sigma in columns
        ]
    )


def _lagged(values: Array, lag: float, step: float) -> Array:
    """Forces that follow with a time constant [s]."""
    if lag == 0.0:
        return values
    kept, out = float(np.exp(-step / lag)), values.copy()
    for at in range(1, values.size):
        out[at] = kept * out[at - 1] + (1.0 - kept) * values[at]
    return out
