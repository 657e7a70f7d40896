"""What the daemon says of the first seconds in which the wheel drives."""

from __future__ import annotations

import pytest

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.tools.service.first_look import FirstLook

USUAL = {
    "wheel_speed": 0.3,
    "wheel_speed_sigma": 0.001,
    "carriage_speed": 0.017,
    "sinkage": 0.02,
    "load": 70.0,
    "torque": 2.0,
    "drawbar_pull": 5.0,
}


@pytest.fixture(scope="module")
def settings() -> Settings:
    return load(packaged()).settings


def said(settings: Settings, ticks: int = 300, **values: float) -> list[str]:
    look, lines = FirstLook(), []
    for number in range(ticks):
        row = [0.0] * len(TICK_NAMES)
        for name, value in (USUAL | values).items():
            row[TICK_NAMES.index(name)] = value
        row[TICK_NAMES.index("evaluated")] = 1e17 + 1e8 * number
        lines += [notice.text for notice in look.look(tuple(row), settings)]
    return lines


def test_a_usual_drive_has_no_line(settings: Settings) -> None:
    assert said(settings) == []


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("load", -70.0, "load"),
        ("carriage_speed", 0.17, "slip"),
        ("sinkage", 0.2, "sinkage"),
        ("torque", -2.0, "torque"),
        ("drawbar_pull", 60.0, "pull"),
    ],
)
def test_what_cannot_be_is_told_once(
    settings: Settings, name: str, value: float, word: str
) -> None:
    (line,) = said(settings, **{name: value})
    assert word in line


def test_a_wheel_at_rest_tells_nothing(settings: Settings) -> None:
    assert said(settings, wheel_speed=0.0, load=-70.0) == []
    assert said(settings, ticks=50, load=-70.0) == []


def test_a_wheel_in_the_air_is_no_mistake(settings: Settings) -> None:
    assert said(settings, load=0.1, torque=0.02, drawbar_pull=0.0, sinkage=-0.01) == []
