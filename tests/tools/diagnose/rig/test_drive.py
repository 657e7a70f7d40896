"""The adapter of a drive without soil: what it recovers from a drive whose constants are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import CommandError
from gritd.tools.diagnose.fit.problem import Problem, free_of
from gritd.tools.diagnose.noise.colour import Colour, Noise
from gritd.tools.diagnose.rig.drive import DriveRig
from gritd.tools.diagnose.rig.interface import Stack
from gritd.tools.diagnose.rig.signals import Series

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


def rig(series: dict[str, Series]) -> DriveRig:
    settings = config.load(packaged()).settings
    one = replace(
        settings.drive, torque_constant=replace(settings.drive.torque_constant, value=1.0)
    )
    return DriveRig([series], ["to and fro"], replace(settings, drive=one))


def fitted(made: DriveRig) -> dict[str, float]:
    stack = Stack(made)
    effects = [EFFECTS[name] for name in EFFECTS_OF_FRICTION]
    noise = Noise(
        stack, (Colour(0.1, 0.5, 0.0),), ((),), np.zeros(stack.size), np.zeros((stack.size, 0))
    )
    problem = Problem(stack, noise, np.zeros((stack.size, 0)))
    found = problem.descend(
        effects, free_of(effects), np.zeros(len(made.constants)), np.array([1.0, 0.1])
    )
    constants = {k.name: k.of(float(u)) for k, u in zip(made.constants, found.u, strict=True)}
    values = zip(found.free, found.x, strict=True)
    return constants | {
        f.parameter.name: f.value(float(x)) * made.unit_factor(f.parameter.unit) for f, x in values
    }


def test_mass_and_friction_of_a_known_drive_are_recovered() -> None:
    found = fitted(rig(log()))
    assert found["inertia"] == pytest.approx(INERTIA, rel=0.005)
    assert found["damping"] == pytest.approx(DAMPING, rel=0.01)
    assert found["loss"] == pytest.approx(LOSS, rel=0.01)
    assert found["offset"] == pytest.approx(0.0, abs=0.1)
    assert found["torque_delay"] == pytest.approx(0.0, abs=2e-4)


def test_a_current_that_lags_by_two_samples_costs_nothing_but_the_delay() -> None:
    found = fitted(rig(log(late=2e-3)))
    assert found["torque_delay"] == pytest.approx(2e-3, abs=3e-4)
    assert found["inertia"] == pytest.approx(INERTIA, rel=0.01)
    assert found["damping"] == pytest.approx(DAMPING, rel=0.015)


def test_reversals_count_but_a_drive_at_rest_does_not() -> None:
    series = log()
    time, position = series["wheel_encoder"]
    stands = time > 12.0
    run = rig(series | {"wheel_encoder": (time, np.where(stands, position[12000], position))}).runs[
        0
    ]
    counted = run.used["torque"]
    assert counted[run.time < 11.5].mean() > 0.97
    assert not counted[run.time > 13.0].any()


def test_what_both_sides_are_filtered_by_blurs_neither() -> None:
    stack = Stack(rig(log()))
    assert not stack.rig.blur(stack, stack.measured).any()


def test_a_log_that_is_too_short_is_refused_in_one_line() -> None:
    with pytest.raises(
        CommandError, match=r"to and fro: found 1\.00 s of position and current; expected 2 s"
    ):
        rig(log(seconds=1.0))
