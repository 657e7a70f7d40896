"""A gap of a recording takes neither ticks nor points of a grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.limits import VARIABLE
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.offline.gaps import GAP, MARGIN, built_ticks, edges_of
from gritd.estimator.offline.playback import ticks_at
from gritd.estimator.recording.mcapfile import RecordingError

PERIOD = NS // 10
APART = st.one_of(
    st.integers(0, 3 * PERIOD),
    st.integers(GAP - 2 * PERIOD, GAP + 2 * PERIOD),
    st.integers(GAP, 50 * 366 * 86_400 * NS),
)


@given(st.lists(APART, max_size=25), st.integers(0, NS))
def test_ticks_over_gaps(apart: list[int], start: int) -> None:
    """The same from arrays and one after the other: as if every tick were made, but for those more
    than GAP after the last reading.
    """
    received = start + np.cumsum([0, *apart], dtype=np.int64)
    ticks = built_ticks(received, PERIOD)
    readings = [Reading(t, "wheel_encoder", 0, t) for t in received.tolist()]
    played = list(ticks_at(readings, NS / PERIOD))

    assert [tick.stamp for tick in played] == ticks.tolist()
    assert [r for tick in played for r in tick.readings] == readings
    assert all(r.received <= tick.stamp for tick in played for r in tick.readings)
    assert np.all((ticks - start) % PERIOD == 0) and np.all(np.diff(ticks) > 0)
    assert len(ticks) <= len(received) * (GAP // PERIOD + 2)

    before = np.searchsorted(received, ticks, "right") - 1
    silent = ticks - received[before]
    assert np.all(silent < GAP + PERIOD)
    jumps = np.flatnonzero(np.diff(ticks) > PERIOD)
    assert np.all(silent[jumps] >= GAP) and np.all(silent[jumps + 1] < PERIOD)


def test_a_recording_without_readings_has_no_ticks() -> None:
    assert built_ticks(np.empty(0, np.int64), PERIOD).size == 0


@pytest.mark.parametrize("silence", [5.0, 60.0, 86_400.0, 1.5e9])
def test_the_middle_of_a_gap_is_one_point(silence: float) -> None:
    beats = np.concatenate(
        [np.arange(0.0, 30.0, 0.01), 30.0 + silence + np.arange(0.0, 30.0, 0.01)]
    )
    edges = edges_of(beats + 1e9, 1e9, 1e9 + beats[-1], 10.0) - 1e9
    middle = 0.5 * (edges[1:] + edges[:-1])

    filled = (middle < 30.0) | (middle > 30.0 + silence)
    assert np.count_nonzero(filled) == pytest.approx(600, abs=2)
    assert np.count_nonzero(~filled) <= (2 * MARGIN + 3 if silence > 10.0 else 51)
    np.testing.assert_allclose(np.diff(edges)[filled], 0.1, atol=1e-6)
    assert np.count_nonzero(np.diff(edges) > 0.11) == (silence > 10.0)


def test_more_than_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "ticks=100, grid=100")
    received = np.arange(0, 20 * NS, PERIOD)
    readings = (Reading(t, "wheel_encoder", 0, t) for t in received.tolist())
    for made in (
        lambda: built_ticks(received, PERIOD),
        lambda: list(ticks_at(readings, NS / PERIOD)),
    ):
        with pytest.raises(RecordingError, match="more than 100 ticks; GRITD_LIMITS='ticks=400'"):
            made()
    with pytest.raises(RecordingError, match="more than 100 points; GRITD_LIMITS='grid=400'"):
        edges_of(received / NS, 0.0, 19.9, 10.0)
