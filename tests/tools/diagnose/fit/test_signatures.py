"""Signatures: the derivative of what is measured by a strength, also where the full strength would
run away.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.motor_heating import MotorHeating
from gritd.tools.diagnose.fit.signatures import shape_grid, signature, strengths
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

SHAPE = {"duration": 100.0}


class Bench:
    """Ten values of about 1 that grow with the strength, and past `limit` without bound, as a motor
    that runs away.
    """

    size, measured = 10, np.linspace(0.5, 1.5, 10)
    rig = SimpleNamespace(channels=("torque",))

    def __init__(self, limit: float) -> None:
        self.limit = limit

    def of(self, _: str) -> Any:
        return np.ones(self.size, bool)

    def predict(self, _: Any, effects: tuple[MotorHeating, ...], *__: Any) -> Any:
        strength = sum(getattr(effect, strengths(MotorHeating)[0].name) for effect in effects)
        return self.measured * (1.0 + strength if strength < self.limit else np.exp(1e9 * strength))


def of_bench(limit: float) -> Any:
    bench: Any = Bench(limit)
    return signature(bench, np.zeros(0), bench.predict(None, ()), MotorHeating, SHAPE)


def test_a_signature_is_the_change_by_the_expected_size() -> None:
    expected = strengths(MotorHeating)[0].sigma * Bench.measured
    np.testing.assert_allclose(of_bench(np.inf).columns[:, 0], expected)


def test_one_that_runs_away_is_taken_from_a_smaller_step() -> None:
    sigma = strengths(MotorHeating)[0].sigma
    np.testing.assert_allclose(of_bench(0.5 * sigma).columns[:, 0], sigma * Bench.measured)


def test_one_that_runs_away_however_weak_is_none() -> None:
    assert of_bench(0.0) is None


def test_one_that_changes_nothing_is_none() -> None:
    """On fresh soil what earlier passes leave cannot be told, wherever the constants stand."""
    rig = wheel_rig(record(plan(seed=3, seconds=20.0), ()), settings())
    stack, u = Stack(rig), np.full(len(rig.constants), 0.5)
    effect = EFFECTS["multipass"]
    shape = next(shape_grid(rig, effect))
    assert signature(stack, u, stack.predict(u), effect, shape) is None
