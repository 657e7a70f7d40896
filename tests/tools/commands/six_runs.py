"""Six runs of the simulator, each at one load, on one bed: what they know together beside what the
best of them knows alone. Every seed draws a soil from the stated prior and a testbed whose
calibrations are off by their own sigmas.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from math import exp, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Repeatability, Settings, settings_of_run
from gritd.estimator.filter.estimate import KPA, TAN_PHI, C, Estimate
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.bed_runs import BedRun, bed_runs
from gritd.estimator.recording.recording import Recording
from gritd.estimator.recording.salvage import read
from gritd.estimator.terramechanics.soil import Soil
from gritd.tools.testbed.drawn_rig import drawn_rig
from gritd.tools.testbed.run_files import write
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of

LOADS = (30.0, 45.0, 60.0, 75.0, 90.0, 105.0)  # [N]
SLIPS = (0.1, 0.2, 0.3, 0.45, 0.6)
SPEED = 0.02  # [m/s]
SEGMENT = 5.0  # [s]
RATE = 100.0  # [Hz] of the sensors


class Outcome(NamedTuple):
    """One seed: errors of the joint estimate over its σ, and how much narrower it is."""

    c: float
    tan_phi: float
    c_narrower: float  # than the best single run
    tan_phi_narrower: float

    @property
    def met(self) -> bool:
        """c and tan φ inside 2 σ, and three times narrower than the best single run."""
        inside = max(abs(self.c), abs(self.tan_phi)) <= 2.0
        return inside and min(self.c_narrower, self.tan_phi_narrower) >= 3.0


def outcome(seed: int, share: float = 0.0) -> Outcome:
    """Six runs on one bed. share: repeatability of preparations, of c and of tan φ."""
    configuration = config.load(packaged())
    settings, rng = configuration.settings, np.random.default_rng(seed)
    soil, rig = drawn_soil(settings, rng), drawn_rig(settings, rng)
    prior = settings.soil
    stated = Repeatability(share * prior.cohesion.value, share * prior.tan_phi.value)

    with tempfile.TemporaryDirectory() as folder:
        given = []
        for number, load in enumerate(LOADS):
            ground = prepared(soil, stated, rng)
            path = Path(folder) / f"{number}.mcap"
            recording = recorded(configuration, rig, ground, load, path, int(rng.integers(2**31)))
            given.append((settings_of_run(settings, recording.run), recording))
        runs = list(bed_runs(given, stated))
    return judged(runs, soil)


def drawn_soil(settings: Settings, rng: np.random.Generator) -> Soil:
    """A soil from the stated prior; k is lognormal, c at least 50 Pa."""
    prior, (a, b, c) = settings.soil, rng.normal(size=3)
    spread = prior.shear_modulus.sigma / prior.shear_modulus.value

    return soil_of(
        settings,
        {
            "cohesion": max(prior.cohesion.value + prior.cohesion.sigma * a, 50.0),
            "tan_phi": prior.tan_phi.value + prior.tan_phi.sigma * b,
            "shear_modulus": prior.shear_modulus.value * exp(spread * c),
        },
    )


def prepared(soil: Soil, by: Repeatability, rng: np.random.Generator) -> Soil:
    """The soil of one preparation."""
    a, b = rng.normal(size=2)
    return replace(
        soil,
        cohesion=max(float(soil.cohesion) + by.cohesion * a, 0.0),
        tan_phi=float(soil.tan_phi) + by.tan_phi * b,
    )


def recorded(
    configuration: Configuration, rig: Settings, soil: Soil, load: float, path: Path, seed: int
) -> Recording:
    """One run at one load through the slips, made on the true rig and told by the stated one."""
    schedule = Schedule(tuple(Segment(SEGMENT, load, slip, SPEED) for slip in SLIPS), 0.5)
    motion = motion_of(schedule, rig.wheel.radius, RATE)
    run = simulate_run(rig, soil, motion, (), seed)
    write(path, configuration, RunInfo(name=path.stem, nominal_load=load), run)
    return read(path)


def judged(runs: list[BedRun], soil: Soil) -> Outcome:
    """The last estimate of the bed beside the truth and beside the best single run."""
    known = runs[-1].known.estimate
    c, tan_phi = _sigmas(known)
    alone = [_sigmas(run.alone.estimate) for run in runs]
    return Outcome(
        (known.x[C] * KPA - float(soil.cohesion)) / c,
        (known.x[TAN_PHI] - float(soil.tan_phi)) / tan_phi,
        min(each[0] for each in alone) / c,
        min(each[1] for each in alone) / tan_phi,
    )


def _sigmas(estimate: Estimate) -> tuple[float, float]:
    """Of c [Pa] and of tan φ."""
    return sqrt(estimate.P[C][C]) * KPA, sqrt(estimate.P[TAN_PHI][TAN_PHI])
