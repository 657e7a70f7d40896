"""An effect that gains in one stretch of the recordings alone is no explanation of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.breadth import Breadth


class _Model:
    """strains: of the soil's constant and of the two of an instrument."""

    def __init__(
        self, evidence: float, *names: str, strains: tuple[float, ...] = (0.0, 0.0, 0.0)
    ) -> None:
        self.evidence, self.names = evidence, names
        self.fitted = SimpleNamespace(u=np.array(strains))


class _Search:
    """A base model, one without effects, and two with effects."""

    def __init__(self, habit: float, strains: tuple[float, ...], stage: str) -> None:
        without_b = _Model(50.0, "a", strains=strains)
        self.models = (_Model(0.0), _Model(0.0), without_b, _Model(80.0, "a", "b"))
        self.first = type("Screen", (), {"habit": {"b": habit}})()
        constants = [SimpleNamespace(soil=soil) for soil in (True, False, False)]
        rig = SimpleNamespace(
            constants=constants,
            effects=dict.fromkeys("ab", SimpleNamespace(stage=stage)),
            forms=(SimpleNamespace(drive=False), SimpleNamespace(drive=True)),
        )
        stack = SimpleNamespace(rig=rig)
        self.problem = SimpleNamespace(stack=stack)

    def news(self, model: _Model) -> float:
        return model.evidence - TUNING.screen.habit * self.first.habit["b"] * ("b" in model.names)

    weight = news


def _counted(
    gains: Any,
    monkeypatch: pytest.MonkeyPatch,
    habit: float = 0.0,
    strains: tuple[float, ...] = (0.0, 0.0, 0.0),
    stage: str = "drivetrain",
) -> float:
    """The evidence of both effects together, where the second gains as given and relieves these
    strains, on a rig that measures the loss of the drive.
    """
    search: Any = _Search(habit, strains, stage)
    own = {"a": np.full(20, 5.0), "b": np.asarray(gains)}
    monkeypatch.setattr("gritd.tools.diagnose.verdict.breadth.stretches", lambda _: [])
    test = Breadth(search)
    monkeypatch.setattr(test, "gains", lambda model, name: own[name])
    monkeypatch.setattr(
        test, "without", lambda m, name: search.models[2] if name == "b" else search.models[1]
    )
    return test.evidence()[search.models[3]]


def test_a_few_stretches_do_not_pay_for_an_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _counted([20.0, 10.0, *[0.0] * 18], monkeypatch) == -np.inf


def test_many_small_gains_do(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _counted([1.5] * 20, monkeypatch) == 80.0


def test_what_the_reference_shows_is_no_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = 30.0 / TUNING.screen.habit
    assert _counted([1.5] * 20, monkeypatch, habit=shown) == 50.0


def test_a_loss_of_the_drive_gains_what_it_relieves_the_instruments_of(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A sensor 3 σ off its calibration predicts every stretch as well as the loss does."""
    nothing = [0.0] * 20
    assert _counted(nothing, monkeypatch, strains=(0.0, 3.0, 0.0)) == 80.0
    assert _counted(nothing, monkeypatch, strains=(0.0, 1.5, 0.0)) == -np.inf
    assert _counted(nothing, monkeypatch, strains=(5.0, 0.0, 0.0)) == -np.inf  # the soil's
    assert _counted(nothing, monkeypatch, strains=(0.0, 3.0, 0.0), stage="testbed") == -np.inf


def test_an_effect_of_a_sensor_gains_what_its_calibration_is_relieved_of(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A torque constant 5 % off predicts no better than a calibration 5 σ off."""
    nothing = [0.0] * 20
    assert _counted(nothing, monkeypatch, strains=(0.0, 5.0, 0.0), stage="sensor") == 80.0
    assert _counted(nothing, monkeypatch, strains=(5.0, 0.0, 0.0), stage="sensor") == -np.inf
