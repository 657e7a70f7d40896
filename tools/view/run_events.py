"""What happened in a recorded run, as its ticks tell."""

from __future__ import annotations

from collections.abc import Iterator

from gritd.estimator.messages.status import CHANNEL_BITS, Flag
from gritd.tools.view.events import BAD, GOOD, MOST, NOTE, ViewEvent
from gritd.tools.view.run_curves import RunCurves, changes, rises


def events_of(run: RunCurves) -> list[ViewEvent]:
    """In order; times since the start of the run [s]."""
    found = [ViewEvent(float(run.time[row]), kind, text) for row, kind, text in _found(run)]
    return sorted(found)[:MOST]


def _found(run: RunCurves) -> Iterator[tuple[int, str, str]]:
    flags = run.column("flags")
    for row in changes(flags, Flag.CHANGED)[0]:
        yield row, NOTE, "the soil changed: σ of c and tan φ is widened"
    for row in rises(run.column("resets")):
        yield row, NOTE, "the covariance was reset: the innovations disagreed"

    for bit, begins, ends in (
        (
            Flag.PRIOR,
            "the estimate is not believed: c, tan φ and k are the prior",
            "it is believed again",
        ),
        (Flag.MISMATCH, "model and measurement disagree", "model and measurement agree again"),
    ):
        rising, falling = changes(flags, bit)
        yield from ((row, BAD, begins) for row in rising)
        yield from ((row, GOOD, ends) for row in falling)

    for name, of_channel in CHANNEL_BITS.items():
        for field in ("stale", "stuck"):
            rising, falling = changes(run.column(field), of_channel)
            words = name.replace("_", " ")
            yield from ((row, BAD, f"{words} is {field}") for row in rising)
            yield from ((row, GOOD, f"{words} is back") for row in falling)
