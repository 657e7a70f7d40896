"""What a daemon and a replay say of trouble: status, monitor, journal, the last estimate."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.daemon.feed import Feed
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.tools.commands import monitor, replay_report
from gritd.tools.commands.status import summary
from gritd.tools.service.incidents import OVER, PAUSE, Recurring
from tests.estimator.daemon.reports import REPORT
from tests.wording.commands import simulated
from tests.wording.rig import output, said

PULL = {"channel": "drawbar_pull", "since": 3723.0, "sigmas": 4.21}
LOOK = 0.1  # [s]


@output
def daemon_in_trouble(folder: Path) -> Iterator[str]:
    for title, told in {
        "model and measurement disagree": {"flags": ["MISMATCH"], "disagreement": PULL},
        "the filter's estimate is not believed": {"status": "AT_BOUND", "flags": ["PRIOR"]},
    }.items():
        yield from (f"--- {title} ---", *summary({**REPORT, **told}))
        yield from ("--- the same in the monitor ---", *monitor.lines({**REPORT, **told}))

    yield "--- the journal of a channel that is stuck, silent and well again ---"
    yield from journal((5.0, Status.TRACKING, 0, 0), (3.0, Status.STUCK, 0, 1),
                       (3.0, Status.STALE, 1, 0), (5.0, Status.TRACKING, 0, 0))  # fmt: skip
    yield "--- the journal of one frame lost, of a hundred, and of one at each look ---"
    for totals in ([0, 0, 1], [0, 3, *range(4, 104)], range(round(2 * PAUSE / LOOK))):
        yield from counted([*totals])


@output
def replay_of_no_estimate(folder: Path) -> Iterator[str]:
    for consistency, flags in ((np.nan, Flag.NONE), (1.25, Flag.PRIOR | Flag.MISMATCH)):
        rows = np.ones(3, dtype=[(name, "<f8") for name in TICK_NAMES])
        rows["consistency"], rows["flags"] = consistency, flags
        rows["status"] = Status.MISMATCH if flags else Status.TRACKING
        rows["stamp"] = rows["evaluated"] = 1e9 * np.arange(3)
        yield replay_report.report(Path("run.mcap"), rows, "ticks")


def thinned(run: Path, path: Path, kept: Mapping[str, slice]) -> None:
    """Of these channels of a recording the readings of a slice, in the packaged configuration."""
    recording = read(run)
    writer = RunWriter(path, (), packaged().read_text(encoding="utf-8"), RunInfo())
    for channel, part in kept.items():
        rows = recording.arrays(f"/raw/{channel}")[part]
        values = rows[rows.dtype.names[-1]]
        for stamp, value in zip(rows["stamp"].tolist(), values.tolist(), strict=True):
            writer.reading(Reading(stamp, channel, value, stamp))
    writer.close()


@output
def replay_without_a_window(folder: Path) -> Iterator[str]:
    """Readings out of their range, a moment, channels that are too slow or absent."""
    list(simulated(folder, 60.0))
    shutil.copy(packaged("testbed.dbc"), folder)
    text = packaged().read_text(encoding="utf-8")
    narrow = text.replace("range: [0.1 V, 4.9 V]", "range: [4.8 V, 4.9 V]", 1)
    (folder / "narrow.yaml").write_text(narrow, encoding="utf-8")
    yield from said(folder, "replay", "run-60.mcap", "--config", "narrow.yaml")

    slow = {"wheel_encoder": slice(None, None, 25), "sinkage_pot": slice(None)}
    for name, kept in {"moment": {"sinkage_pot": slice(4)}, "slow": slow}.items():
        thinned(folder / "run-60.mcap", folder / f"{name}.mcap", kept)
        yield from said(folder, "replay", f"{name}.mcap")


def journal(*stretches: tuple[float, Status, int, int]) -> Iterator[str]:
    """Over stretches of (seconds, status, stale, stuck)."""
    feed, number, used = Feed(), 0, {"wheel_encoder": CHANNEL_BITS["wheel_encoder"]}
    for seconds, status, stale, stuck in stretches:
        for _ in range(round(seconds / LOOK)):
            given = {"stamp": number * 10**8, "status": status, "stale": stale, "stuck": stuck}
            tick = tuple(float(given.get(name, 0.0)) for name in TICK_NAMES)
            yield from (f"{LOOK * number:.1f} s: {n.text}" for n in feed.look(tick, used))
            number += 1


def counted(totals: list[int]) -> Iterator[str]:
    """While a counter takes these values, one a look, and long after."""
    recurring = Recurring("frames lost")
    for number, total in enumerate([*totals, *[totals[-1]] * round((PAUSE + 2 * OVER) / LOOK)]):
        if notice := recurring.look(total, LOOK * number):
            yield f"{LOOK * number:.1f} s: {notice.text}"
