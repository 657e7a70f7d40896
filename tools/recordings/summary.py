"""What a recording holds, topic by topic: messages, rate and the longest gap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.messages.readings import NS
from gritd.estimator.recording.salvage import Recording

LATE = 5.0  # usual distances between two messages beyond which a distance is a gap


class TopicSummary(NamedTuple):
    """One topic of a run, over all its parts. Times count from the run's first message."""

    topic: str
    messages: int
    rate: float  # [Hz], by the usual distance of two messages; 0 for fewer than two
    gaps: int  # distances of more than LATE times the usual one
    longest: float  # [s] the largest distance
    at: float  # [s] where it begins


class RunSummary(NamedTuple):
    """A run over all its parts."""

    start: int  # receive time of the first message [ns since the epoch]
    duration: float  # [s]
    topics: tuple[TopicSummary, ...]


def summary(recordings: Sequence[Recording]) -> RunSummary:
    """What the parts of a run hold together."""
    times = times_of(recordings)
    if not times:
        return RunSummary(0, 0.0, ())

    start = min(int(own[0]) for own in times.values())
    end = max(int(own[-1]) for own in times.values())
    topics = [topic_summary(topic, own, start) for topic, own in sorted(times.items())]
    return RunSummary(start, (end - start) / NS, tuple(topics))


def times_of(recordings: Sequence[Recording]) -> dict[str, NDArray[np.int64]]:
    """Receive times (n,) [ns] of every topic's messages, ascending."""
    pieces_of: dict[str, list[NDArray[np.int64]]] = {}
    for recording in recordings:
        for chunk in recording.chunks():
            for channel, own in chunk.groups.items():
                times = chunk.heads["log_time"][own].astype(np.int64)
                pieces_of.setdefault(recording.sources[channel].topic.name, []).append(times)

    return {topic: np.sort(np.concatenate(pieces)) for topic, pieces in pieces_of.items()}


def topic_summary(topic: str, times: NDArray[np.int64], start: int) -> TopicSummary:
    """times: of its messages (n,) [ns], ascending; start: of the run [ns]."""
    apart = np.diff(times)
    usual = float(np.median(apart)) if apart.size else 0.0
    if not usual:
        return TopicSummary(topic, times.size, 0.0, 0, 0.0, 0.0)

    longest = int(np.argmax(apart))
    return TopicSummary(
        topic,
        times.size,
        NS / usual,
        int(np.count_nonzero(apart > LATE * usual)),
        float(apart[longest]) / NS,
        float(times[longest] - start) / NS,
    )
