"""Message records of a chunk as arrays: their heads, and the index of a channel's messages."""

from __future__ import annotations

import struct

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log_time, publish_time
MESSAGE_DTYPE = np.dtype(
    {
        "names": ["opcode", "length", "channel", "sequence", "log_time", "publish_time"],
        "formats": ["<u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
        "offsets": [0, 1, 9, 11, 15, 23],
        "itemsize": MESSAGE_HEAD.size,
    }
)

Starts = NDArray[np.int64]


def gather(
    content: bytes | bytearray | memoryview, starts: Starts, dtype: np.dtype[np.void]
) -> NDArray[np.void]:
    """Records of `dtype` that stand at byte offsets `starts`, shape (n,), in `content`: a copy,
    shape (n,).

    Every record must lie inside: starts + dtype.itemsize <= len(content).
    """
    if starts.size == 0:
        return np.empty(0, dtype)

    room = len(content) - dtype.itemsize + 1
    windows = np.ndarray((room,), np.dtype((np.void, dtype.itemsize)), content, strides=(1,))
    return np.asarray(windows[starts]).view(dtype)


def message_index(channel: int, heads: NDArray[np.void], offsets: Starts) -> tuple[int, bytes]:
    """(channel, MessageIndex record): log_time and offset inside the chunk of each message of the
    channel.
    """
    own = np.flatnonzero(heads["channel"] == channel)
    pairs = np.empty((own.size, 2), "<u8")
    pairs[:, 0], pairs[:, 1] = heads["log_time"][own], offsets[own]
    entries = pairs.tobytes()

    head = RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + len(entries)) + struct.pack(
        "<HI", channel, len(entries)
    )
    return channel, head + entries
