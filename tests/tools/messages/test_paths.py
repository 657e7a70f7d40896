"""Fields of nested messages by their path."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.messages.paths import getter, leaves, number, stamp

NAMES = st.text("abcdefg_", min_size=1, max_size=5).filter(
    lambda name: name not in ("name", "names", "sec", "nanosec")
)
NUMBERS = st.floats(allow_nan=False, width=32) | st.integers(-(2**31), 2**31) | st.booleans()
MESSAGES = st.recursive(
    NUMBERS | st.lists(NUMBERS, max_size=4).map(np.array),
    lambda inner: (
        st.dictionaries(NAMES, inner, min_size=1, max_size=4)
        | st.lists(st.dictionaries(NAMES, NUMBERS, min_size=1, max_size=3), min_size=1, max_size=3)
    ),
    max_leaves=12,
)


@given(st.dictionaries(NAMES, MESSAGES, min_size=1, max_size=4))
def test_every_field_that_is_offered_is_found_by_its_path(message: dict[str, Any]) -> None:
    for path, value in leaves(message):
        assert getter(path)(message) == number(value), path


@given(st.text(max_size=30), st.dictionaries(NAMES, MESSAGES, max_size=3))
def test_any_path_is_a_number_or_none(path: str, message: dict[str, Any]) -> None:
    assert isinstance(getter(path)(message), float)


JOINTS = {
    "header": {"stamp": {"sec": 3, "nanosec": 250_000_000}},
    "name": ["arm", "wheel"],
    "position": np.array([0.5, 1.5]),
    "effort": np.array([]),
    "motors": [{"name": "left", "current": 2.0}, {"name": "right", "current": 4.0}],
    "ready": True,
}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("position[wheel]", 1.5),
        ("position[0]", 0.5),
        ("position[2]", math.nan),
        ("position[cart]", math.nan),
        ("effort[wheel]", math.nan),
        ("motors[right].current", 4.0),
        ("motors[0].current", 2.0),
        ("header.stamp", 3.25),
        ("ready", 1.0),
        ("name[0]", math.nan),
        ("position", math.nan),
        ("speed.x", math.nan),
    ],
)
def test_an_element_by_its_number_or_its_name(path: str, value: float) -> None:
    assert getter(path)(JOINTS) == pytest.approx(value, nan_ok=True)


def test_when_a_message_was_measured() -> None:
    assert stamp(JOINTS) == 3_250_000_000
    assert stamp({"data": 1.0}) is None
    first = SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace(secs=1, nsecs=5)))
    assert stamp(first) == 1_000_000_005
