"""Message records of many readings at once: the same bytes as one by one, in less time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from gritd.estimator.recording.cdr import BILLION, ENCAPSULATION, Topic
from gritd.estimator.recording.message_records import MESSAGE_DTYPE, MESSAGE_HEAD, RECORD_HEAD

Bytes = NDArray[np.uint8]
Stamps = NDArray[np.int64]
LATEST = 2**31 * BILLION  # [ns] a stamp's seconds have 31 bits


def records(
    topic: Topic, channel: int, first: int, stamps: Stamps, values: NDArray[np.generic]
) -> Bytes:
    """Records (n, size) of a flat topic whose first field is the stamp, from stamps (n,) [ns] and
    values (n,) or (n, fields); `first` is the sequence number of the first. The log time is the
    stamp. Raises ValueError where they do not fit.
    """
    dtype = topic.codec.record_dtype(MESSAGE_HEAD.size)
    made = np.zeros(stamps.size, dtype)
    raw = made.view(np.uint8).reshape(stamps.size, dtype.itemsize)
    _fill_heads(raw, channel, first, stamps)

    columns = values[:, None] if values.ndim == 1 else values
    names = (dtype.names or ())[2:]  # behind the stamp's two
    if not np.all((stamps >= 0) & (stamps < LATEST)) or columns.shape[1] != len(names):
        raise ValueError(f"{topic.name}: stamps or values do not fit its fields")

    made[f"{topic.names[0]}.sec"], made[f"{topic.names[0]}.nanosec"] = np.divmod(stamps, BILLION)
    for name, column in zip(names, columns.T, strict=True):
        if not np.can_cast(column.dtype, dtype[name], "same_kind"):
            raise ValueError(f"{topic.name}: {column.dtype} does not fit {name}")
        made[name] = column
    return raw


def _fill_heads(raw: Bytes, channel: int, first: int, stamps: Stamps) -> None:
    """MCAP's head of a message, and that of its CDR, in records (n, size)."""
    head = np.zeros(stamps.size, MESSAGE_DTYPE)
    head["opcode"], head["length"] = Opcode.MESSAGE, raw.shape[1] - RECORD_HEAD.size
    head["channel"] = channel
    head["sequence"] = (first + np.arange(stamps.size)) & 0xFFFFFFFF
    head["log_time"] = head["publish_time"] = stamps
    end = MESSAGE_HEAD.size
    raw[:, :end] = head.view(np.uint8).reshape(stamps.size, end)
    raw[:, end : end + 4] = np.frombuffer(ENCAPSULATION.to_bytes(4, "little"), np.uint8)


def merged(each: Sequence[Bytes], stamps: Sequence[Stamps]) -> tuple[Bytes, Stamps]:
    """Records (n, size) of several channels, each by rising stamps (n,), as one string of bytes in
    the order of the stamps, then of the channels; and where each record ends.
    """
    counts = [part.shape[0] for part in each]
    sizes = np.repeat([part.shape[1] for part in each], counts)
    order = np.argsort(np.concatenate(stamps), kind="stable")

    ends = np.cumsum(sizes[order])
    begins = np.empty_like(ends)
    begins[order] = ends - sizes[order]
    whole = np.empty(int(ends[-1]) if ends.size else 0, np.uint8)
    for part, begin in zip(each, np.split(begins, np.cumsum(counts)[:-1]), strict=True):
        _places(whole, part.shape[1])[begin] = part.view(f"V{part.shape[1]}")[:, 0]
    return whole, ends


def _places(whole: Bytes, size: int) -> NDArray[np.void]:
    """Every place (n,) in a string of bytes at which so many may stand; they overlap."""
    room = max(whole.size - size + 1, 0)
    return np.ndarray((room,), np.dtype((np.void, size)), whole, strides=(1,))
