"""Events: what of two reports in a row is worth a mark."""

from __future__ import annotations

from typing import Any

import pytest

from gritd.tools.view.events import BAD, GOOD, NOTE, Events
from tests.tools.view.samples import DEVICE, report

OFF = {"channel": "torque", "since": 0.0, "sigmas": 5.0}
LOST = {"encoders": {**DEVICE, "state": "WAITING"}, "bus": DEVICE}
FULL = {**report()["log"], "state": "degraded", "error": "no space"}


def kinds(*reports: dict[str, Any]) -> list[tuple[str, str]]:
    events = Events()
    for at, each in enumerate(reports):
        events.look(each, float(at))
    return [(event.kind, event.text) for event in events.found]


@pytest.mark.parametrize(
    "change, kind, word",
    [
        ({"flags": ["CHANGED"]}, NOTE, "soil"),
        ({"tick": {"resets": 1}}, NOTE, "reset"),
        ({"flags": ["PRIOR"]}, BAD, "not believed"),
        ({"disagreement": OFF}, BAD, "torque"),
        ({"devices": LOST}, BAD, "encoders"),
        ({"channels": {"motor_shunt": "stuck"}}, BAD, "motor shunt"),
        ({"log": FULL}, BAD, "no space"),
        ({"log": {**report()["log"], "file": "run.1.mcap"}}, NOTE, "part"),
        ({"pid": 78}, NOTE, "daemon"),
    ],
)
def test_a_change_is_one_event(change: dict[str, Any], kind: str, word: str) -> None:
    tick = change.pop("tick", {})
    found = kinds(report(0.0), report(0.1, tick, **change), report(0.2, tick, **change))
    assert [k for k, _ in found] == [kind] and word in found[0][1]


@pytest.mark.parametrize("change", [{"devices": LOST}, {"channels": {"motor_shunt": "stale"}}])
def test_what_is_lost_is_told_when_it_is_back(change: dict[str, Any]) -> None:
    found = kinds(report(0.0), report(0.1, **change), report(0.2))
    assert [kind for kind, _ in found] == [BAD, GOOD]


def test_channels_that_come_at_the_start_are_no_event() -> None:
    starting = report(0.0, status="STARTING", channels={"motor_shunt": "stale"})
    assert kinds(starting, report(0.1), report(0.2)) == []


def test_what_a_device_says_is_shown_without_control_characters() -> None:
    hostile = {**FULL, "error": "\x1b[2J\u202e" + "x" * 1000}
    [(_, text)] = kinds(report(0.0), report(0.1, log=hostile))
    assert text.isprintable() and len(text) <= 300
