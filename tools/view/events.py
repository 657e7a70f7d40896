"""What happened, as marks on every time axis: each report is compared with the one before."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

from gritd.estimator.visible import visible
from gritd.tools.service.client import Report

MOST = 500  # events kept
GOOD, NOTE, BAD = "good", "note", "bad"


class ViewEvent(NamedTuple):
    """time: [s since the epoch]."""

    time: float
    kind: str  # GOOD, NOTE or BAD
    text: str


class Events:
    """Follows the reports in order."""

    def __init__(self) -> None:
        self.found: deque[ViewEvent] = deque(maxlen=MOST)
        self.count = 0
        self._before: Report | None = None
        self._lost: set[str] = set()  # what was said to be lost

    def look(self, report: Report, time: float) -> None:
        """Add what is new. A field of another kind than the daemon's raises as Python does."""
        before, self._before = self._before, report
        if before is None:
            return
        if before["pid"] != report["pid"]:
            self.add(ViewEvent(time, NOTE, "another daemon has started"))
            return
        for kind, text in (*_news(before, report), *self._parts(before, report)):
            self.add(ViewEvent(time, kind, text))

    def add(self, event: ViewEvent) -> None:
        self.found.append(event._replace(text=visible(event.text)[:300]))
        self.count += 1

    def _parts(self, before: Report, now: Report) -> Iterator[tuple[str, str]]:
        """Channels and devices that are lost; and back, where their loss was reported."""
        for name, (was, is_now) in _states(before, now).items():
            good = is_now in ("ok", "OPEN")
            if was == is_now or (good and name not in self._lost):
                continue
            self._lost = self._lost - {name} if good else self._lost | {name}
            yield (GOOD, f"{name} is back") if good else (BAD, f"{name} is {is_now.lower()}")

    def listed(self) -> list[dict[str, Any]]:
        return [event._asdict() for event in self.found]


def _news(before: Report, now: Report) -> Iterator[tuple[str, str]]:
    yield from _filter_news(before, now)
    yield from _agreement(before.get("disagreement"), now.get("disagreement"))

    if before["log"]["state"] != now["log"]["state"]:
        writing = now["log"]["state"] == "writing"
        yield GOOD if writing else BAD, f"the log is {now['log']['state']} {now['log']['error']}"
    elif before["log"]["file"] != now["log"]["file"]:
        yield NOTE, "a new part of the recording begins"


def _states(before: Report, now: Report) -> dict[str, tuple[str, str]]:
    """Then and now of every channel that has spoken, and of every device."""
    channels = {
        name.replace("_", " "): (before["channels"].get(name, state), state)
        for name, state in now["channels"].items()
        if now["status"] != "STARTING"
    }
    devices = {
        f"device {name}": (before["devices"].get(name, stats)["state"], stats["state"])
        for name, stats in now["devices"].items()
    }
    return {**channels, **devices}


def _filter_news(before: Report, now: Report) -> Iterator[tuple[str, str]]:
    if "CHANGED" in now["flags"] and "CHANGED" not in before["flags"]:
        yield NOTE, "the soil changed: σ of c and tan φ is widened"
    if now["tick"].get("resets", 0) > before["tick"].get("resets", 0):
        yield NOTE, "the covariance was reset: the innovations disagreed"

    if "PRIOR" in now["flags"] and "PRIOR" not in before["flags"] and now["tick"]:
        yield BAD, "the estimate is not believed: c, tan φ and k are the prior"
    if "PRIOR" in before["flags"] and "PRIOR" not in now["flags"] and now["tick"]:
        yield GOOD, "the estimate is believed again"


def _agreement(before: Report | None, now: Report | None) -> Iterator[tuple[str, str]]:
    if now and not before:
        yield BAD, f"model and measured {now['channel'].replace('_', ' ')} disagree"
    if before and not now:
        yield GOOD, "model and measurement agree again"
