"""Recordings as a page shows them: at once from a first look, then from all of their ticks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np

from gritd.estimator.config.configuration import ConfigError, loads
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.recording.glance import glance
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.recording import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.visible import visible
from gritd.tools.cli import files
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.recordings.difference import differences
from gritd.tools.service.setup import setup
from gritd.tools.view.charts import CHARTS, layout
from gritd.tools.view.frame import Setup, moment
from gritd.tools.view.run_curves import TICK_FIELDS, Along, RunCurves
from gritd.tools.view.run_events import events_of
from gritd.tools.view.words import headline

PLACES = 200  # of a first look
SMALL = 8 << 20  # [bytes] what is read whole at once
WAY = 300  # points of the way of (c, tan φ)
UNSEEN = 5.0  # [s] after which the rest is read though no page was drawn
TABLES = {"/tick": TICK_FIELDS}


@dataclass
class ViewedRun:
    """One recording. The curves are replaced when all of it is read."""

    path: Path
    name: str
    load: float | None  # [N]
    setup: Setup
    curves: RunCurves
    damage: list[str] = field(default_factory=list)
    operator: str = ""
    notes: str = ""

    def described(self) -> dict[str, Any]:
        return {
            "name": visible(self.name),
            "file": visible(str(self.path)),
            "start": self.curves.start * 1e-9,
            "duration": self.curves.duration,
            "way": float(self.curves.way[-1]),
            "load": self.load,
            "whole": self.curves.whole,
            "operator": visible(self.operator),
            "notes": visible(self.notes),
            "testbed": self.setup.testbed,
            **_end(self.curves),
            "prior": self.setup.prior,
            "damage": [visible(line) for line in self.damage[:5]],
        }


def _nothing() -> None:
    """Nobody wants to know."""


class Recordings:
    """Several runs. Raises CommandError for a file that is none, or without ticks."""

    def __init__(self, paths: Sequence[Path], looked: Callable[[], None] = _nothing) -> None:
        """`looked` is called after the first look at each."""
        self.runs: list[ViewedRun] = []
        for path in paths:
            self.runs.append(first_look(path))
            looked()
        self._drawn = Event()  # a page has its first curves: until then nothing else is done
        self._rest = Thread(target=self._read_on, name="reader", daemon=True)

    def start(self) -> None:
        """Read the rest of them."""
        self._rest.start()

    def described(self) -> dict[str, Any]:
        return {
            "live": False,
            "charts": layout(CHARTS),
            "runs": [run.described() for run in self.runs],
            "busy": any(not run.curves.whole for run in self.runs),
        }

    def differences(self, run: int, other: int) -> list[dict[str, Any]]:
        """How two runs differ in what they were made with. Raises RecordingError, OSError."""
        first, second = (glance(self.runs[number].path, {}, 0) for number in (run, other))
        return [
            {name: visible(text) for name, text in vars(each).items()} | {"matters": each.matters}
            for each in differences(first, second)
        ]

    def events(self, run: int = 0) -> list[dict[str, Any]]:
        return [event._asdict() for event in events_of(self.runs[run].curves)]

    def stretch(
        self, run: int, along: Along, span: tuple[float, float] | None, points: int
    ) -> tuple[Array, Array, Array]:
        """Places (p,), columns of the charts (p, m), the way of (c, tan φ) (q, 2)."""
        curves = self.runs[run].curves
        end = float(curves.axis(along)[-1])
        chosen = span or (0.0, float(np.nextafter(end, np.inf)))
        fewer = points if curves.whole else min(points, PLACES)
        drawn = *curves.stretch(along, chosen, fewer), curves.way_of_the_soil(along, chosen, WAY)
        self._drawn.set()
        return drawn

    def moment(self, run: int, along: Along, at: float) -> dict[str, Any]:
        """What the page shows of an instant of a run."""
        chosen = self.runs[run]
        row = chosen.curves.nearest(along, at)
        tick = chosen.curves.tick(row)
        status, flags = Status(tick["status"]), tick["flags"]
        fields = {
            "status": status.name,
            "flags": [flag.name for flag in Flag if flag and flags & flag],
            "channels": {name: _condition(tick, bit) for name, bit in CHANNEL_BITS.items()},
            "hanging": "",
            "devices": {},
            "log": {"state": "writing"},
        }

        words = headline(fields)
        return {
            **moment(tick, chosen.setup),
            "headline": words._asdict(),
            "status": status.name,
            "flags": fields["flags"],
            "sequence": tick["sequence"],
            "time": float(chosen.curves.time[row]),
            "way": float(chosen.curves.way[row]),
        }

    def _read_on(self) -> None:
        for run in self.runs:
            if not run.curves.whole:
                self._drawn.wait(UNSEEN)
                try:
                    recording = files.recording(run.path, TABLES)
                    run.curves = _curves(recording, whole=True).prepared()
                    run.damage = recording.damage
                except (CommandError, RecordingError) as error:
                    run.damage = [str(error)]


def _end(curves: RunCurves) -> dict[str, str]:
    """Status and estimate at the end, in words."""
    tick = curves.tick(len(curves.time) - 1)
    texts = {v["label"]: f"{v['value']} ± {v['sigma']}" for v in moment(tick, Setup())["values"]}
    return {"status": Status(tick["status"]).name, "c": texts["c"], "tan_phi": texts["tan φ"]}


def _condition(tick: dict[str, Any], bit: int) -> str:
    return "stale" if tick["stale"] & bit else "stuck" if tick["stuck"] & bit else "ok"


def first_look(path: Path) -> ViewedRun:
    """A run, all of it where that is quick. Raises CommandError."""
    try:
        whole = path.stat().st_size <= SMALL
        recording = files.recording(path, TABLES) if whole else glance(path, TABLES, PLACES)
        curves = _curves(recording, whole)
    except OSError as error:
        found = (error.strerror or str(error)).lower()
        raise CommandError(f"{path}: found {found}; expected a recording", USAGE) from None
    except RecordingError as error:
        raise files.unread(path, error) from None

    name = path.stem
    damage = recording.damage if whole else []
    run = recording.run
    of_run = (run.nominal_load, _setup(recording, name), curves, damage, run.operator, run.notes)
    return ViewedRun(path, name, *of_run)


def _curves(recording: Recording, whole: bool) -> RunCurves:
    """Raises CommandError where there are no ticks."""
    rows = recording.tables(TABLES)["/tick"] if "/tick" in recording.topics else None
    if rows is None or not len(rows):
        how = f"gritd replay {recording.path} -o NEW.mcap computes them"
        raise CommandError(f"{recording.path}: found no ticks; expected some: {how}", DAMAGED)
    return RunCurves.of(rows, whole)


def _setup(recording: Recording, name: str) -> Setup:
    """Of the recorded configuration; nothing where it is not readable."""
    try:
        settings = loads(recording.config_yaml or "", str(recording.path)).settings
    except ConfigError:
        return Setup(run=name)
    return Setup.of_report({"setup": setup(settings, name)})
