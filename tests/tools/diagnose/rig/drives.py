"""A drive whose constants are known, and the constants that the adapter of a drive finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.problem import Problem, free_of
from gritd.tools.diagnose.noise.colour import Colour, Noise
from gritd.tools.diagnose.rig.drive import drive_rig
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import Series
from gritd.tools.diagnose.rig.stack import Stack

INERTIA, DAMPING, LOSS = 95.0, 200.0, 20.0
RATE = 1000.0  # [Hz] of the log
EFFECTS_OF_FRICTION = ["coulomb_friction", "current_offset"]


def log(seconds: float = 20.0, late: float = 0.0) -> dict[str, Series]:
    """A drive to and fro, its current `late` seconds behind its position."""
    time = np.arange(0.0, seconds, 1.0 / RATE)
    position = swing(time)[0]
    torque = force(*swing(time - late)[1:])
    noise = np.random.default_rng(2).standard_normal((2, time.size))
    return {
        "wheel_encoder": (time, position + 1e-7 * noise[0]),
        "motor_shunt": (time, torque + 0.3 * noise[1]),
    }


def swing(time: Array) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration, rich enough to tell mass from friction."""
    parts = [(0.05, 1.0), (0.004, 7.0), (0.002, 11.0)]
    position = sum(a * np.sin(w * time) for a, w in parts)
    speed = sum(a * w * np.cos(w * time) for a, w in parts)
    return (
        np.asarray(position),
        np.asarray(speed),
        np.asarray(-sum(a * w * w * np.sin(w * time) for a, w in parts)),
    )


def force(speed: Array, acceleration: Array) -> Array:
    return np.asarray(INERTIA * acceleration + DAMPING * speed + LOSS * np.sign(speed))


def rig(series: dict[str, Series]) -> Rig:
    settings = config.load(packaged()).settings
    one = replace(
        settings.drive, torque_constant=replace(settings.drive.torque_constant, value=1.0)
    )
    return drive_rig([series], ["to and fro"], replace(settings, drive=one))


def fitted(made: Rig) -> dict[str, float]:
    stack = Stack(made)
    effects = [EFFECTS[name] for name in EFFECTS_OF_FRICTION]
    noise = Noise(stack, (Colour(0.1, 0.5, 0.0),), np.zeros(stack.size), np.zeros((stack.size, 0)))
    problem = Problem(stack, noise, np.zeros((stack.size, 0)))
    found = problem.descend(
        effects, free_of(effects), np.zeros(len(made.constants)), np.array([1.0, 0.1])
    )
    constants = {k.name: k.of(float(u)) for k, u in zip(made.constants, found.u, strict=True)}
    values = zip(found.free, found.x, strict=True)
    return constants | {
        f.parameter.name: f.value(float(x)) * made.unit_factors.get(f.parameter.unit, 1.0)
        for f, x in values
    }
