"""The record is judged and linearised anew a share a tick, with the result of doing it at once."""

from __future__ import annotations

from itertools import pairwise

import pytest

from gritd.estimator.filter import review, smoother
from gritd.estimator.filter.review import Reviewer
from gritd.estimator.filter.track import Passing, Relining
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online import checkpoint
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator import live_run
from tests.estimator.live_run import SETTINGS


@pytest.fixture(scope="module")
def consumed():
    return live_run.consumed()


def _finished(reviewer, state, step):
    while state.task is not None:
        state = step(reviewer, state)
    return state


def run(consumed):
    """The states after each tick, and the ticks as dictionaries."""
    pipeline = Pipeline(SETTINGS)
    state, states, ticks = pipeline.start(), [], []
    for stamp, batch in consumed:
        state, row = pipeline.step(state, batch, stamp)
        states.append(state)
        ticks.append(dict(zip(TICK_NAMES, row, strict=True)))
    return states, ticks


def test_spread_over_ticks_or_at_once_a_window_leaves_the_same(consumed, monkeypatch):
    spread, reported = run(consumed)
    step = Reviewer.step
    monkeypatch.setattr(Reviewer, "step", lambda self, state: state)
    monkeypatch.setattr(Reviewer, "finished", lambda self, state: _finished(self, state, step))
    at_once, _ = run(consumed)

    windows = [n for n, tick in enumerate(reported) if tick["torque_z"] != 0.0]
    assert len(windows) > 60
    for n in windows:
        assert spread[n].track == at_once[n].track
    assert any(tick["flags"] & Flag.CHANGED for tick in reported)


def test_no_tick_between_windows_takes_more_than_its_share_of_tangents(consumed, monkeypatch):
    """Nor is anything left for a tick that closes a window, with a memory as short as this."""
    taken, line_of = [], smoother.line_of

    def counted(*arguments):
        taken.append(1)
        return line_of(*arguments)

    monkeypatch.setattr(smoother, "line_of", counted)
    pipeline, between, closing = Pipeline(SETTINGS), [], []
    state = pipeline.start()
    for stamp, batch in consumed:
        taken.clear()
        before = state
        state, _ = pipeline.step(state, batch, stamp)
        closed = state.track.window_end != before.track.window_end
        (closing if closed else between).append(len(taken))
    assert max(between) == review.LINES
    assert sum(count > 0 for count in between) > 5
    assert max(closing) == 1  # that of the open stretch


def test_the_estimate_stays_what_the_window_left_until_the_record_was_passed(consumed):
    states, _ = run(consumed)
    under_way = [
        (before.track, after.track)
        for before, after in pairwise(states)
        if before.track.task is not None and after.track.task is not None
        if before.track.resets == after.track.resets
        if not (isinstance(before.track.task, Passing) and isinstance(after.track.task, Relining))
    ]
    assert under_way
    assert all(before.estimate == after.estimate for before, after in under_way)


def test_every_step_of_a_review_is_read_back_from_a_checkpoint_to_the_same_bits(consumed):
    states, _ = run(consumed)
    pipeline = Pipeline(SETTINGS)
    seen = {}
    for n, state in enumerate(states):
        if state.track.task is not None:
            seen.setdefault(type(state.track.task).__name__, n)
    assert {"Ended", "Judging", "Again", "Relining", "Passing"} <= seen.keys()

    for n in seen.values():
        restored = checkpoint.decode(checkpoint.encode(states[n]), pipeline.settings)
        assert restored.track == states[n].track
