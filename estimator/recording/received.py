"""When the messages of a file were received, where its writer left no log times that are times:
when they were published, else what the stamps at their beginning say.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.recording.cdr import ALIASES, BILLION, TIME, Rows
from gritd.estimator.recording.decoding import CDR_LE, MessageHeads, RecordedChannel
from gritd.estimator.recording.message_records import MESSAGE_HEAD, gather

Times = NDArray[np.int64]
MOST = 0.01  # share of the times that may be none
PUBLISHED = "its log times are no times; taken are those of publishing"
STAMPED = "its log times are no times; taken are the stamps of its messages"
HEADERS = {"std_msgs/Header", "std_msgs/msg/Header", "Header"}
_STAMP = np.dtype(  # of a message that begins with one, behind the head of its record
    [("kind", "<u2"), ("options", "<u2"), ("seconds", "<i4"), ("rest", "<u4")]
)


class LogTimes:
    """Whether log times [ns] are times: most are later than 1970, and they differ."""

    def __init__(self) -> None:
        self._count, self._none = 0, 0
        self._first, self._last = 2**64, 0

    def add(self, times: NDArray[np.uint64]) -> None:
        if not times.size:
            return
        self._count += times.size
        self._none += int(np.count_nonzero(times - np.uint64(1) >= np.uint64(2**63 - 1)))
        self._first = min(self._first, int(times.min()))
        self._last = max(self._last, int(times.max()))

    @property
    def good(self) -> bool:
        differ = self._count < 2 or self._first < self._last
        return self._none <= MOST * self._count and differ


def received(
    chunks: Iterable[MessageHeads], sources: Mapping[int, RecordedChannel]
) -> tuple[Times | None, str]:
    """Times [ns] of all messages in file order, shape (n,), in place of log times that are none,
    and where they are from; None where nothing tells.
    """
    stamped = {channel for channel, source in sources.items() if _begins_with_stamp(source)}
    published, stamps = LogTimes(), LogTimes()
    parts = []

    for chunk in chunks:
        own = np.zeros(len(chunk.starts), np.int64)
        for channel in stamped & chunk.groups.keys():
            own[chunk.groups[channel]] = _stamps(chunk, chunk.groups[channel])
        parts.append((chunk.heads["publish_time"].astype(np.int64), own))
        published.add(chunk.heads["publish_time"])
        stamps.add(own[own != 0].view(np.uint64))

    if published.good and parts:
        return np.concatenate([sent for sent, _ in parts]), PUBLISHED
    if stamps.good and any(np.any(own) for _, own in parts):
        return _carried_on(np.concatenate([own for _, own in parts])), STAMPED
    return None, ""


def _begins_with_stamp(source: RecordedChannel) -> bool:
    """Whether the first field of a message is a time, or a header, which begins with one."""
    schema = source.schema
    if schema is None or schema.encoding != "ros2msg" or source.channel.message_encoding != "cdr":
        return False
    text = re.sub(r"#.*", "", schema.data.decode(errors="replace"))
    kind = (text.split() or [""])[0]
    return kind in HEADERS or ALIASES.get(kind, kind) == TIME


def _stamps(chunk: MessageHeads, own: Times) -> Times:
    """The stamps of messages (n,) [ns]; 0 of one that is too short or in another encoding."""
    end = MESSAGE_HEAD.size + _STAMP.itemsize
    fits = chunk.starts[own] + end <= len(chunk.content)
    made = np.zeros(own.size, np.int64)
    rows: Rows = gather(chunk.content, chunk.starts[own[fits]] + MESSAGE_HEAD.size, _STAMP)
    times = rows["seconds"].astype(np.int64) * BILLION + rows["rest"]
    made[fits] = np.where((rows["kind"] == CDR_LE) & (times > 0), times, 0)
    return made


def _carried_on(times: Times) -> Times:
    """Each time that is 0 is the one before it; those at the beginning the first that is."""
    place = np.where(times > 0, np.arange(times.size), 0)
    carried = times[np.maximum.accumulate(place)]
    first = int(times[np.argmax(times > 0)])
    return np.where(carried > 0, carried, first)
