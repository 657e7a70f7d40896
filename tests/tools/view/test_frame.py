"""What the page shows of a moment: the daemon's numbers, the right words, physics to scale."""

from __future__ import annotations

import json
from math import cos, sqrt
from typing import Any

import numpy as np
import pytest

from gritd.estimator.messages.status import Status
from gritd.estimator.terramechanics.soil import Wheel
from gritd.tools.view.frame import Setup, frame
from gritd.tools.view.rim import rim
from gritd.tools.view.words import SENTENCES, headline
from tests.tools.view.samples import TICK, report

WHEEL = Wheel(0.072, 0.071)


def test_every_status_has_its_words() -> None:
    assert set(SENTENCES) == set(Status)
    for status in Status:
        assert headline(report(status=status.name)).title


@pytest.mark.parametrize(
    "change, word",
    [
        ({"hanging": "loop"}, "loop"),
        ({"unfed": "motor_shunt is silent"}, "motor_shunt is silent"),
    ],
)
def test_trouble_comes_before_the_status(change: dict[str, Any], word: str) -> None:
    words = headline(report(**change))
    assert words.tone == "bad" and word in words.reason


@pytest.mark.parametrize("flag", ["PRIOR", "NOT_SEPARABLE", "CHANGED", "LOAD_ASSUMED"])
def test_what_must_be_known_beside_the_status_is_a_note(flag: str) -> None:
    assert headline(report()).notes == ()
    assert len(headline(report(flags=[flag])).notes) == 1


def test_values_are_those_of_the_tick_in_their_units() -> None:
    shown = frame(report(), Setup.of_report(report()))
    values = {v["label"]: (v["value"], v["sigma"], v["unit"]) for v in shown["values"]}
    assert values["c"] == ("812", "35", "Pa")
    assert values["tan φ"] == ("0.5771", "0.0123", "")
    assert values["k"] == ("25.1", "1.1", "mm")
    assert values["pull"] == ("−3.00", "0.05", "N")
    json.dumps(shown, allow_nan=False)


def test_without_a_tick_and_from_an_older_daemon_there_is_a_frame() -> None:
    old = {**report(status="STARTING"), "tick": {}, "loop": {"ticks": 0}, "channels": {}}
    for key in ("setup", "sensors", "wall_clock"):
        del old[key]
    shown = frame(old, Setup.of_report(old))
    assert shown["values"] == [] and shown["ellipse"] is None and shown["rim"] is None


def test_the_ellipse_has_the_spread_of_both() -> None:
    ellipse = frame(report(), Setup())["ellipse"]
    assert ellipse["ax"] == pytest.approx(2 * TICK["cohesion_sigma"])
    assert sqrt(ellipse["ay"] ** 2 + ellipse["by"] ** 2) == pytest.approx(2 * 0.0123)
    assert ellipse["ax"] * ellipse["ay"] == pytest.approx(4 * TICK["cov_c_tan_phi"])


def test_stresses_under_the_rim_carry_the_load() -> None:
    """W = r b ∫ (σ cos θ + τ sin θ) dθ, Eq. (9)."""
    drawn = rim(WHEEL, TICK)
    assert drawn is not None
    theta, sigma, tau = (np.array(drawn[name]) for name in ("theta", "sigma", "tau"))
    along = (sigma * np.cos(theta) + tau * np.sin(theta)) * 1e3
    load = WHEEL.radius * WHEEL.width * np.sum((along[1:] + along[:-1]) / 2 * -np.diff(theta))
    assert load == pytest.approx(TICK["load"], rel=0.01)
    assert WHEEL.radius * (1 - cos(drawn["theta"][0])) == pytest.approx(0.0169, abs=1e-3)


@pytest.mark.parametrize("change", [{"theta_1": 0.0}, {"load": 0.0}, {"slip": float("nan")}])
def test_a_wheel_that_touches_nothing_has_no_stresses(change: dict[str, float]) -> None:
    assert rim(WHEEL, {**TICK, **change}) is None
