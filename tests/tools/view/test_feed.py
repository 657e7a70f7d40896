"""The feed follows the daemon: its reports, its end, its next start, and what is no daemon."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from queue import Queue
from typing import Any

import numpy as np
import pytest

from gritd.estimator.daemon.publish import Publisher
from gritd.tools.view.charts import CHARTS, LATENESS, drawn, fields_of
from gritd.tools.view.feed import DaemonFeed
from tests.tools.view.samples import TICK, daemon, report

Frames = Queue[dict[str, Any]]
LONG = 180.0  # [s] ends a test that has failed


@pytest.fixture
def followed(tmp_path: Path) -> Any:
    """A feed of the socket in the folder, and the frames it makes."""
    frames: Frames = Queue()
    with closing(DaemonFeed(str(tmp_path / "gritd.sock"))) as feed:
        feed.start(lambda frame: frames.put(json.loads(frame)))
        yield feed, frames


def until(frames: Frames, right: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while not right(frame := frames.get(timeout=LONG)):
        pass
    return frame


def is_live(frame: dict[str, Any]) -> bool:
    return frame["time"] is not None


def test_frames_and_curves_hold_what_the_daemon_says(followed: Any, tmp_path: Path) -> None:
    feed, frames = followed
    with daemon(tmp_path / "gritd.sock"):
        for _ in range(3):
            frame = until(frames, is_live)
        time, columns, way = feed.stretch(None, 60.0, 100)
    assert frame["values"][0] == {"label": "c", "value": "812", "sigma": "35", "unit": "Pa"}
    assert frame["prior"]["cohesion"] == [1000.0, 300.0]
    assert frame["row"][:3] == [812.0, 742.0, 882.0]  # the line, and the edges of ± 2σ

    assert len(time) >= 3 and time[-1] >= frame["time"]
    assert columns[-1, :3].tolist() == frame["row"][:3]
    assert way[-1].tolist() == pytest.approx([812.0, 0.5771])


def test_a_daemon_that_ends_and_starts_again_is_followed(followed: Any, tmp_path: Path) -> None:
    feed, frames = followed
    with daemon(tmp_path / "gritd.sock"):
        first = until(frames, is_live)
    gone = until(frames, lambda frame: not is_live(frame))
    assert gone["headline"]["tone"] == "bad"

    with daemon(tmp_path / "gritd.sock", lambda at: report(at + 100.0, pid=78)):
        until(frames, is_live)
    kinds = [event["kind"] for event in feed.events()]
    assert "bad" in kinds and len(kinds) >= 3  # lost, answers, another daemon

    time, columns, _ = feed.stretch(None, 1000.0, 100)
    assert time[0] == pytest.approx(first["time"], abs=0.5) and time[-1] > first["time"] + 99.0
    assert np.isnan(columns[:, 0]).any()  # the line is parted


def test_a_daemon_with_an_earlier_clock_begins_the_history_anew(
    followed: Any, tmp_path: Path
) -> None:
    feed, frames = followed
    with daemon(tmp_path / "gritd.sock"):
        until(frames, is_live)
    with daemon(tmp_path / "gritd.sock", lambda at: report(at - 5000.0)):
        early = until(frames, lambda frame: is_live(frame) and frame["sequence"] < 0)
    time, _, _ = feed.stretch(None, 1e5, 100)
    assert time[0] <= early["time"] and time[-1] - time[0] < 60.0


@pytest.mark.parametrize("what", [{}, {"status": "DANCING"}, {"tick": {"cohesion": "much"}}])
def test_what_is_no_daemon_is_said_to_be_none(
    followed: Any, tmp_path: Path, what: dict[str, Any]
) -> None:
    _, frames = followed
    wrong = {**report(), **what} if what else {"status": "TRACKING"}
    publisher = Publisher(tmp_path / "gritd.sock", lambda: wrong)
    publisher.start()
    with closing(publisher):
        frame = until(frames, lambda f: "no gritd" in f["headline"]["reason"])
    assert frame["time"] is None


def test_columns_are_the_curves_in_order_with_their_bands() -> None:
    charts = (*CHARTS, LATENESS)
    fields = fields_of(charts)
    row = np.array([[TICK.get(name, 0.0) for name in fields]])
    count = sum(3 if curve.sigma else 1 for chart in charts for curve in chart.curves)
    assert drawn(charts, fields, row).shape == (1, count)
