"""The first sentences of a diagnosis."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gritd.tools.diagnose.explain.result import Fit, Location
from gritd.tools.diagnose.explain.summary import summary, worse
from gritd.tools.diagnose.screen.evidence import Pass
from gritd.tools.diagnose.screen.screening import Screen
from gritd.tools.diagnose.verdict.decision import Resembled

SCREEN = Screen(Pass(9.0, {}), {}, 0.0, False, 1.0, 0.0)
RIG: Any = SimpleNamespace(new=[True])
PLACE = Location("torque", "speed", 0.9, 0.003, 0.003, "Torque, 0.3 N·m more than the model")


def _fit(torque: tuple[float, float], sinkage: tuple[float, float] = (0.004, 0.001)) -> Fit:
    """Held-out errors before and after."""
    units = {"torque": "N·m", "sinkage": "m"}
    before, after = ({"torque": torque[n], "sinkage": sinkage[n]} for n in range(2))
    return Fit(units, before, after, {"torque": 0.01, "sinkage": 0.0005})


def _decision(verdict: str, *names: str, **more: Any) -> Any:
    kept = {"groups": {}, "share": 0.9, "resembled": (), "probability": {}, "unlisted": 1.0, **more}
    return SimpleNamespace(verdict=verdict, best=SimpleNamespace(names=names), **kept)


def test_it_begins_with_the_place_and_the_error_on_unseen_runs_before_and_after() -> None:
    shown = summary(_decision("explained", "a"), [PLACE], _fit((0.3, 0.02)), SCREEN, RIG)
    place, _, names = shown.partition(";")
    assert place.startswith(PLACE.where)
    assert names.index("0.3") < names.index("0.02") < names.index("90 %")


def test_a_channel_that_is_foretold_worse_comes_first() -> None:
    """A torque that is mapped to the wrong side of a friction."""
    fit = _fit((0.16, 0.27))
    assert worse(fit) == ["torque"] and not worse(_fit((0.3, 0.02)))
    shown = summary(_decision("explained", "coulomb_friction"), [PLACE], fit, SCREEN, RIG)
    assert shown.startswith("In part only: torque") and "0.16" in shown and "0.27" in shown
    assert "configuration" in shown


def test_a_zero_that_no_run_foretells_is_no_fault_of_the_configuration() -> None:
    decision = _decision("explained", "sensor_drift")
    shown = summary(decision, [PLACE], _fit((0.16, 0.27)), SCREEN, RIG)
    assert "what sensor_drift does" in shown and "configuration" not in shown


@pytest.mark.parametrize("names", [("a",), ("a", "b")])
def test_it_says_which_name_has_rivals(names: tuple[str, ...]) -> None:
    decision = _decision("explained", *names, groups={names[-1]: ("d", "c")})
    shown = summary(decision, [PLACE], _fit((0.3, 0.02)), SCREEN, RIG)
    assert "cannot be distinguished from d" in shown
    alone = summary(_decision("explained", *names), [PLACE], _fit((0.3, 0.02)), SCREEN, RIG)
    assert "distinguished" not in alone


def test_an_effect_that_must_be_bent_far_is_said_to_resemble() -> None:
    model: Any = SimpleNamespace(form_share=lambda name: 0.4)
    resembled = Resembled("torque_constant_error", 0.42, model)
    decision = _decision("unlisted", resembled=(resembled,))
    shown = summary(decision, [PLACE], _fit((0.3, 0.3)), SCREEN, RIG)
    assert "resembles torque_constant_error" in shown and "42 %" in shown and "40 %" in shown


def test_several_that_are_likely_together_but_not_alone_are_told() -> None:
    likely = {"b": 0.26, "a": 0.3, "c": 0.17, "d": 0.01}
    decision = _decision("unlisted", probability=likely, unlisted=0.31)
    shown = summary(decision, [PLACE], _fit((0.3, 0.3)), SCREEN, RIG)
    assert "a (30 %), b (26 %) and c (17 %)" in shown and "31 %" in shown
    alone = _decision("unlisted", probability={"a": 0.3, "b": 0.01}, unlisted=0.69)
    assert "No listed effect" in summary(alone, [PLACE], _fit((0.3, 0.3)), SCREEN, RIG)


def test_agreement_with_a_strained_constant_says_so() -> None:
    fit = _fit((0.01, 0.01))
    assert "σ" not in summary(_decision("consistent"), [], fit, SCREEN, RIG)
    assert "k +3.4 σ" in summary(_decision("consistent"), [], fit, SCREEN, RIG, [("k", 3.4)])
