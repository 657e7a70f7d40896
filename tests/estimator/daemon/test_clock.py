"""The daemon's clock, whatever the wall clock says."""

from __future__ import annotations

from datetime import UTC, datetime
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gritd.estimator.daemon.clock as clocks
from gritd.estimator.recording.cdr import TIME, Codec

NS = 1_000_000_000
UPTIME = 50 * 365 * 86_400 * NS  # [ns] more than a computer stays up
CODEC = Codec([("stamp", TIME, "")])


def started(wall: int, up: int = 10**12) -> tuple[clocks.Clock, int]:
    """A clock started when the wall clock and the monotonic clock show this [ns], and what it
    shows then.
    """
    with pytest.MonkeyPatch.context() as patch:
        simulated = SimpleNamespace(time_ns=lambda: wall, monotonic_ns=lambda: up)
        patch.setattr(clocks, "time", simulated)
        clock = clocks.Clock()
        return clock, clock.now()


@given(st.integers(-(2**63), 2**63 - 1), st.integers(0, UPTIME // 2))
def test_no_wall_clock_makes_a_stamp_that_cannot_be_written(wall: int, up: int) -> None:
    """Any time that the system can tell; 30 days later too."""
    _, stamp = started(wall, up)
    assert stamp > 0
    for later in (0, 30 * 86_400 * NS):
        assert CODEC.decode(CODEC.encode((stamp + later,))) == (stamp + later,)


@pytest.mark.parametrize(
    ("year", "believed"),
    [(1901, False), (1970, False), (2019, False), (2020, True), (2036, True), (2037, False)],
)
def test_a_wall_clock_that_cannot_be_right_is_not_believed(year: int, believed: bool) -> None:
    wall = round(datetime(year, 7, 1, tzinfo=UTC).timestamp()) * NS
    clock, shown = started(wall)
    assert (shown == wall) == believed == (not clock.notice)
    said = f"the wall clock says {year}-07-01 00:00:00, which is not believed: "
    assert believed or clock.notice.startswith(said)
