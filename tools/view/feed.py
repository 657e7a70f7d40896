"""The daemon's reports, followed by a thread for all browsers: one place at its status socket."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import closing
from math import inf, isfinite
from threading import Event as Flag
from threading import Lock, Thread
from typing import Any

import numpy as np

from gritd.estimator.daemon.publish import line_of
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.visible import visible
from gritd.tools.cli.command import CommandError
from gritd.tools.service.client import NO_GRITD, Report, connected, reports
from gritd.tools.view.charts import CHARTS, LATENESS, drawn, fields_of, layout
from gritd.tools.view.downsample import envelope
from gritd.tools.view.events import BAD, NOTE, Events, ViewEvent
from gritd.tools.view.frame import Setup, frame
from gritd.tools.view.history import LONGEST, History

AGAIN = 1.0  # [s] between attempts to reach a daemon that is not there
NS = 1e-9
STARTED_BEFORE = 1.0  # [s] time that goes back by more is another daemon's clock
LIVE = (*CHARTS, LATENESS)
PATH = 300  # points of the way of (c, tan φ)

Receiver = Callable[[bytes], None]
Taken = Callable[[Report], None]


class DaemonFeed:
    """Follows the daemon until closed, also over its end and its next start."""

    def __init__(self, socket: str | None) -> None:
        self._socket = socket
        self._receive: Receiver = _nobody
        self._taken: Taken = _nobody
        self._history = History(fields_of(LIVE))
        self._events = Events()
        self._lock = Lock()
        self._stop = Flag()
        self._setup, self._setup_of = Setup(), ""
        self._trouble = ""
        self._thread = Thread(target=self._run, name="feed", daemon=True)

    def start(self, receive: Receiver, taken: Taken | None = None) -> None:
        """`receive` gets a frame as JSON for every report, `taken` the report; from the thread."""
        self._receive, self._taken = receive, taken or _nobody
        self._thread.start()

    def close(self) -> None:
        """The thread ends with its next report."""
        self._stop.set()

    # --- for the pages ---

    def described(self) -> dict[str, Any]:
        """What a page must know before it draws."""
        return {"live": True, "charts": layout(LIVE), "longest": LONGEST}

    def events(self) -> list[dict[str, Any]]:
        with self._lock:
            return self._events.listed()

    def stretch(
        self, span: tuple[float, float] | None, seconds: float, points: int
    ) -> tuple[Array, Array, Array]:
        """Times (p,), columns of the charts (p, m) and the way of (c, tan φ) (q, 2): of a span, or
        of the last seconds.
        """
        with self._lock:
            since = span[0] if span else self._history.last - seconds
            time, values = self._history.rows(since)
        if not len(time):
            return (
                time,
                np.empty((0, drawn(LIVE, self._history.fields, values).shape[1])),
                np.empty((0, 2)),
            )

        chosen = span or (float(time[-1]) - seconds, float(time[-1]))
        kept = time <= chosen[1]
        columns = drawn(LIVE, self._history.fields, values)
        soil = [self._history.fields.index(name) for name in ("cohesion", "tan_phi")]
        way = values[kept][:, soil]
        return *envelope(time, columns, chosen, points), way[:: max(1, len(way) // PATH)]

    # --- the thread ---

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                with closing(connected(self._socket)) as connection:
                    for report in reports(connection):
                        self._take(report)
                        if self._stop.is_set():
                            return
            except CommandError as error:
                self._lost(str(error))
            self._stop.wait(AGAIN)

    def _take(self, report: Report) -> None:
        """Raises CommandError where the report is not the daemon's."""
        try:
            with self._lock:
                frame = self._frame_of(report)
            self._taken(report)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            raise CommandError(NO_GRITD) from None
        self._receive(frame)

    def _frame_of(self, report: Report) -> bytes:
        now = _time(report)
        if self._history.last - now > STARTED_BEFORE:
            self._history.begin_anew()
        if self._trouble:
            self._trouble = ""
            self._events.add(ViewEvent(now, NOTE, "the daemon answers"))
        self._events.look(report, now)

        setup = json.dumps(report.get("setup"))
        if setup != self._setup_of:
            self._setup, self._setup_of = Setup.of_report(report), setup

        values = {**report["tick"], "lateness": report["loop"].get("lateness")}
        row = self._row(now, values) if self._history.add(now, values) else None
        made = {"time": now, "row": row, "marks": self._events.count, "prior": self._setup.prior}
        return _encoded({**made, **frame(report, self._setup)})

    def _row(self, now: float, values: dict[str, Any]) -> list[float | None]:
        fields = self._history.fields
        row = np.array([[np.nan if (v := values.get(n)) is None else v for n in fields]], float)
        return [float(f"{v:.7g}") if isfinite(v) else None for v in drawn(LIVE, fields, row)[0]]

    def _lost(self, why: str) -> None:
        """No daemon answers: what the page says instead of old values."""
        with self._lock:
            if why != self._trouble:
                last = self._history.last  # by the daemon's clock, which need not be ours
                known = last > -inf
                self._history.interrupt()
                self._events.add(
                    ViewEvent(last if known else time.time(), BAD if known else NOTE, why)
                )
            self._trouble = why
            marks = self._events.count

        words = {"tone": BAD, "title": "No daemon", "reason": visible(why), "notes": []}
        self._receive(_encoded({"time": None, "row": None, "marks": marks, "headline": words}))


def _nobody(what: object) -> None:
    """Nobody wants to know."""


def _time(report: Report) -> float:
    """What the page has as time [s since the epoch]: that of the tick, which describes the bed."""
    stamp = report["tick"].get("evaluated")
    return float(stamp) * NS if stamp else time.time()


def _encoded(message: dict[str, Any]) -> bytes:
    return line_of(message).rstrip()
