"""A simulated run: the motion, what the forward model answers, and what the sensors send."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects.base import Effect
from gritd.estimator.messages.readings import Reading
from gritd.estimator.model.correction import Correction
from gritd.estimator.model.forward import Response, simulate_arrays
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Soil
from gritd.tools.testbed.sensors import readings


@dataclass(frozen=True)
class SimulatedRun:
    """A simulated run: what was commanded, what happened, and what the sensors sent."""

    motion: Motion
    response: Response
    readings: list[Reading]


def simulate_run(
    settings: Settings, soil: Soil, motion: Motion, acting: Sequence[Effect], seed: int
) -> SimulatedRun:
    """Drive a motion (evenly sampled) and read every configured channel at each of its samples."""
    response = answered(settings, soil, motion, acting)
    return SimulatedRun(
        motion, response, readings(settings, motion, response, np.random.default_rng(seed))
    )


def answered(settings: Settings, soil: Soil, motion: Motion, acting: Sequence[Effect]) -> Response:
    """What the forward model says of a motion."""
    return simulate_arrays(
        settings.wheel,
        soil,
        motion,
        acting,
        torque_constant=settings.drive.torque_constant.value,
        correction=correction_of(settings),
    )


def correction_of(settings: Settings) -> Correction | None:
    """The learnt discrepancy of form, where the configuration holds one."""
    return None if settings.discrepancy is None else Correction(settings.discrepancy)


def soil_of(settings: Settings, changed: Mapping[str, float] | None = None) -> Soil:
    """The configured soil, with some of its values replaced; modulus_factor multiplies K."""
    prior, changed = settings.soil, dict(changed or {})
    factor = changed.pop("modulus_factor", 1.0)

    soil = Soil(
        cohesion=prior.cohesion.value,
        tan_phi=prior.tan_phi.value,
        shear_modulus=prior.shear_modulus.value,
        exponent=prior.exponent.value,
        modulus=prior.pressure_sinkage.modulus(settings.wheel.width) * factor,
    )
    return replace(soil, **changed)
