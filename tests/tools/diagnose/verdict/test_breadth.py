"""An effect that gains in one stretch of the recordings alone is no explanation of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.breadth import Breadth


class _Model:
    def __init__(self, evidence: float, *names: str) -> None:
        self.evidence, self.names = evidence, names


class _Search:
    """A base model, one without effects, and two with effects."""

    def __init__(self, habit: float = 0.0) -> None:
        self.models = (_Model(0.0), _Model(0.0), _Model(50.0, "a"), _Model(80.0, "a", "b"))
        self.first = type("Screen", (), {"habit": {"b": habit}})()

    def news(self, model: _Model) -> float:
        return model.evidence - TUNING.screen.habit * self.first.habit["b"] * ("b" in model.names)

    weight = news


def _counted(gains: Any, monkeypatch: pytest.MonkeyPatch, habit: float = 0.0) -> float:
    """The evidence of both effects together, where the second gains as given."""
    search: Any = _Search(habit)
    own = {"a": np.full(20, 5.0), "b": np.asarray(gains)}
    monkeypatch.setattr("gritd.tools.diagnose.verdict.breadth.stretches", lambda _: [])
    search.problem = type("Problem", (), {"stack": None})()
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
