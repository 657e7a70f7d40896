"""A bench that nobody has seen: wheel, soil, sensors, rates, noise, motion, what is stated of it.

Everything true of a bench follows from its stratum and its seed. The literature behind the ranges:
c₁ ≈ 0.4 and 0 ≤ c₂ ≤ 0.3 of Eq. (5), Wong and Reece (1967), Ishigami et al. (2007); soils of
knowledge.FAMILIES.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gritd.tools.proof.blind.knowledge import ground_drawn
from gritd.tools.proof.blind.plant.axle import balance
from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim, reaction
from gritd.tools.proof.blind.plant.quadrature import Array

STRATA = (
    "stated",  # form of the stresses stated, nothing left out
    "open",  # nothing stated but the wheel
    "few",  # likewise, three runs or two
    "torque",  # no drawbar pull; load measured or weighed
    "pull",  # no torque
    "friction",  # the drive keeps a constant torque that nobody states
    "creep",  # the zero of the load cell creeps
    "wall",  # the wheel rubs on the bin's wall, which takes from the pull
    "step",  # the soil changes on the way: at once …
    "ramp",  # … over 20 s …
    "patch",  # … or for 15 to 50 cm
)
LEFT_OUT = ("friction", "creep", "wall")
CHANGES = ("step", "ramp", "patch")
SHALLOW, DEEP = (0.4, 0.55), (0.75, 1.0)  # [rad] entry angles of the lightest and heaviest load
SLIPS = (0.08, 0.15, 0.25, 0.4, 0.55)
CHANGE = (0.2, 0.06)  # most that c and tan φ change by, relative


class ReadingNoise(NamedTuple):
    """Standard deviation of one reading, SI."""

    angle: float
    travel: float
    sinkage: float
    force: float
    torque: float


class SoilChange(NamedTuple):
    """How the soil changes in a run: from `begin` to `end` [s] c and tan φ reach these factors, or,
    of a patch, have them in between.
    """

    kind: str
    cohesion: float
    tan_phi: float
    begin: float
    end: float


class RunPart(NamedTuple):
    """A stretch of a run."""

    duration: float  # [s]
    load: float  # [N]
    slip: float


class DrawnRun(NamedTuple):
    parts: tuple[RunPart, ...]
    course: SoilChange | None = None

    @property
    def duration(self) -> float:
        return float(sum([part.duration for part in self.parts]))


@dataclass(frozen=True)
class Bench:
    """All that is true of a bench."""

    stratum: str
    seed: int
    family: str
    radius: float  # [m]
    width: float  # [m]
    ground: PlantSoil
    c1: float
    c2: float
    rate: float  # of the table [Hz]
    lag: float  # [s] by which forces follow
    speed: float  # of the carriage [m/s]
    noise: ReadingNoise
    motor: bool  # the torque is the motor's
    weighed: bool  # the load is stated of the run, and not measured
    pull: bool  # the drawbar pull is measured
    left_out: float  # [N·m], share of the load, or share: of the stratum's effect
    runs: tuple[DrawnRun, ...]


def drawn(stratum: str, seed: int) -> Bench:
    """A bench of a stratum."""
    rng = np.random.default_rng((seed, STRATA.index(stratum)))
    while True:
        bench = _attempt(stratum, seed, rng)
        if bench is not None:
            return bench


def _attempt(stratum: str, seed: int, rng: np.random.Generator) -> Bench | None:
    family, ground = ground_drawn(rng)
    if family == "clayey soil":  # nobody would leave the prior of a dry sand for it
        return None
    radius = round(float(rng.uniform(0.06, 0.15)), 4)
    width = round(radius * float(rng.uniform(0.55, 1.2)), 4)
    c1, c2 = round(float(rng.uniform(0.36, 0.5)), 3), round(float(rng.uniform(0.0, 0.3)), 3)
    loads = _loads(ground, radius, width, c1, c2, rng)
    if loads is None:
        return None

    heaviest = loads[-1]
    force = float(rng.uniform(0.003, 0.008)) * heaviest
    noise = ReadingNoise(
        float(np.radians(rng.choice((0.01, 0.02, 0.05)))),
        float(rng.choice((1e-5, 2e-5, 5e-5))),
        float(rng.uniform(0.05e-3, 0.15e-3)),
        force,
        force * radius * float(rng.uniform(0.3, 0.8)),
    )
    weighed = stratum == "torque" and bool(rng.random() < 0.5)

    return Bench(
        stratum=stratum,
        seed=seed,
        family=family,
        radius=radius,
        width=width,
        ground=ground,
        c1=c1,
        c2=c2,
        rate=float(rng.choice((20.0, 50.0, 100.0, 200.0))),
        lag=float(rng.choice((0.0, 0.1, 0.3))),
        speed=float(rng.uniform(0.015, 0.04)),
        noise=noise,
        motor=stratum == "friction" or bool(rng.random() < 0.5),
        weighed=weighed,
        pull=stratum != "torque",
        left_out=_left_out(stratum, heaviest, radius, rng),
        runs=_runs(stratum, loads, rng),
    )


def _loads(
    ground: PlantSoil, radius: float, width: float, c1: float, c2: float, rng: np.random.Generator
) -> list[float] | None:
    """Six loads [N], rising; None where no testbed would drive them."""
    rim = Rim(peak=c1 + 0.3 * c2)
    angles = np.array([rng.uniform(*SHALLOW), rng.uniform(*DEEP)])
    light, heavy = reaction(ground, rim, radius, width, np.full(2, 0.7), angles).load
    if not (light > 8.0 and heavy < 400.0 and heavy > 1.8 * light):
        return None

    def load_at(theta_1: Array) -> Array:
        bogged = Rim(peak=c1 + 0.55 * c2)
        return reaction(ground, bogged, radius, width, np.array([0.45]), theta_1).load

    deepest = float(balance(load_at, np.array([heavy]), np.array([0.9]))[0])
    return (
        [round(float(load), 2) for load in np.linspace(light, heavy, 6)] if deepest < 1.2 else None
    )


def _left_out(stratum: str, heaviest: float, radius: float, rng: np.random.Generator) -> float:
    if stratum == "friction":
        return float(rng.uniform(0.03, 0.12)) * heaviest * radius
    if stratum == "creep":
        return float(rng.uniform(0.03, 0.08)) * float(rng.choice((-1.0, 1.0)))
    return float(rng.uniform(0.02, 0.06)) if stratum == "wall" else 0.0


def _runs(stratum: str, loads: list[float], rng: np.random.Generator) -> tuple[DrawnRun, ...]:
    if stratum in CHANGES:
        return (_changing(stratum, loads, rng),)

    count = int(rng.integers(2, 4)) if stratum == "few" else 6
    chosen = loads if count == 6 else [loads[0], loads[-1], loads[2]][:count]
    return tuple([DrawnRun(_parts(load, 6.4, rng)) for load in chosen])


def _parts(load: float, duration: float, rng: np.random.Generator) -> tuple[RunPart, ...]:
    return tuple([RunPart(duration, load, float(slip)) for slip in rng.permutation(SLIPS)])


def _changing(stratum: str, loads: list[float], rng: np.random.Generator) -> DrawnRun:
    """A long run under one load or several, in which the soil changes once."""
    several = bool(rng.random() < 0.7)
    chosen = rng.choice(loads, 3, replace=False) if several else np.full(3, rng.choice(loads))
    parts = [part for load in (*chosen, *chosen) for part in _parts(float(load), 5.0, rng)]

    begin = float(rng.uniform(60.0, 80.0))
    seconds = {"step": 0.0, "ramp": 20.0, "patch": float(rng.uniform(8.0, 20.0))}[stratum]
    cohesion, tan_phi = (float(1.0 + rng.uniform(-most, most)) for most in CHANGE)
    return DrawnRun(tuple(parts), SoilChange(stratum, cohesion, tan_phi, begin, begin + seconds))
