"""Topics as structured arrays, all of them filled in one pass over the file.

What stands alike in a message and in a row of a table is copied as one piece, fields and all, so
that a message of sixty fields costs hardly more than one of two.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from gritd.estimator.compiled import records
from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.recording.cdr import BILLION, TIME, Codec, Rows, Topic
from gritd.estimator.recording.decoding import MessageHeads, RecordedChannel
from gritd.estimator.recording.message_records import MESSAGE_HEAD, Starts, gather

Fields = tuple[str, ...] | None  # of a topic; None for all of them
NOTHING: Mapping[str, Fields] = MappingProxyType({})
ROOM = 256 << 20  # [bytes] of tables that are made though nobody has asked for one yet
KEYS = [("log_time", "<i8"), ("order", "<i8")]  # what a row begins with


class _Piece(NamedTuple):
    """Bytes of a record that become bytes of a row."""

    kind: str  # format in the record
    offset: int
    row_kind: str
    row_offset: int


class _Copy(NamedTuple):
    """How the messages of one source become rows."""

    low: int  # the first byte of a record that is looked at
    record: np.dtype[np.void]
    row: np.dtype[np.void]
    pieces: tuple[str, ...]  # fields of both
    times: tuple[tuple[str, str, str], ...]  # field of the row; seconds and nanoseconds in `record`

    def into(self, rows: Rows, chunk: MessageHeads, own: Starts, before: int) -> None:
        """Decode the messages numbered `own`, shape (n,), into n rows that lie side by side;
        `before` are in the file before the chunk.
        """
        rows["log_time"] = chunk.heads["log_time"][own]
        rows["order"] = own + before

        parts = gather(chunk.content, chunk.starts[own] + self.low, self.record)
        target = rows.view(self.row)
        for name in self.pieces:
            target[name] = parts[name]
        for name, seconds, rest in self.times:
            rows[name] = parts[seconds].astype(np.int64) * BILLION + parts[rest]


class _CompiledCopy(NamedTuple):
    """The same, where every piece is copied as it is."""

    reach: int  # bytes of a record that are looked at
    pieces: tuple[tuple[int, int, int], ...]  # place in the record, in the row, bytes
    times: tuple[tuple[int, int, int], ...]  # place of the seconds, in the row, of the nanoseconds

    def into(self, rows: Rows, chunk: MessageHeads, own: Starts, before: int) -> None:
        """As `_Copy.into`."""
        records.fill(
            chunk.content, chunk.starts, own, rows, self.reach, before, self.pieces, self.times
        )


class Table:
    """The rows of one topic. They are allocated once where the file says how many there are; what
    it says in vain is given back, and where it says too little the rows grow without being copied.
    """

    def __init__(self, topic: Topic, fields: Fields, expected: int = 0) -> None:
        chosen = topic.names if fields is None else fields
        kinds = dict(topic.codec.table_dtype)
        self.dtype = np.dtype([*KEYS, *((name, kinds[name]) for name in chosen)])
        self._names, self._whole = chosen, fields is None
        self._copies: dict[int, _Copy | _CompiledCopy] = {}
        self._used = 0
        try:
            self._rows = np.empty(expected, self.dtype)
        except MemoryError:  # so many there may never be
            self._rows = np.empty(0, self.dtype)

    def fits(self, source: RecordedChannel) -> bool:
        """Whether messages of a source hold the fields of the table, and if all are asked for, no
        others.
        """
        if source.codec is None or (self._whole and source.topic.names != self._names):
            return False
        return set(self._names) <= set(source.codec.names)

    def add(
        self,
        chunk: MessageHeads,
        sources: Mapping[int, RecordedChannel],
        channels: list[int],
        before: int,
    ) -> None:
        """The messages of these channels, all of the table's topic; `before` are in the file before
        the chunk.
        """
        groups = [chunk.groups[channel] for channel in channels]
        own = groups[0] if len(groups) == 1 else np.sort(np.concatenate(groups))
        rows = self._room(len(own))

        for channel, group in zip(channels, groups, strict=True):
            copy = self._copy(channel, sources[channel])
            if len(groups) == 1:
                copy.into(rows, chunk, own, before)
                continue

            places = np.searchsorted(own, group)
            some = rows[places]
            copy.into(some, chunk, group, before)
            rows[places] = some

    def done(self) -> Rows:
        """All rows, shape (n,), which nobody may change: several may ask for them."""
        if self._used < len(self._rows):
            self._rows.resize(self._used, refcheck=False)
        self._rows.flags.writeable = False
        return self._rows

    def _room(self, count: int) -> Rows:
        """The next rows to be filled."""
        start, self._used = self._used, self._used + count
        if self._used > len(self._rows):
            # in place: no view of the rows outlives `add`
            self._rows.resize(self._used + self._used // 8, refcheck=False)
        return self._rows[start : self._used]

    def _copy(self, channel: int, source: RecordedChannel) -> _Copy | _CompiledCopy:
        if channel not in self._copies:
            assert source.codec is not None
            self._copies[channel] = _copy_of(source.codec, self._names, self.dtype, records.BUILT)
        return self._copies[channel]


class Tables:
    """Those that are asked for, by topic; None: all. A topic whose messages have no fixed size is
    left out.
    """

    def __init__(self, wanted: Mapping[str, Fields] | None) -> None:
        self.all = wanted is None
        self.wanted = wanted or NOTHING
        self.expected = Counter[str]()  # how many messages of each topic there should be
        self.refused = set[str]()  # topics of which a channel lacks a field
        self._tables: dict[str, Table] = {}

    def begin(self, sources: Mapping[int, RecordedChannel]) -> None:
        """Once it is known which topics there are, and how many messages of each: all are made if
        they fit in ROOM.
        """
        if not self.all:
            return
        topics = {s.topic.name: s.topic for s in sources.values() if s.codec and s.topic.codec.flat}
        sizes = (self.expected[n] * Table(t, None).dtype.itemsize for n, t in topics.items())
        if integer_sum(sizes) <= ROOM:
            self.wanted = dict.fromkeys(topics)

    def add(self, chunk: MessageHeads, sources: Mapping[int, RecordedChannel], before: int) -> None:
        """The messages of a chunk that `before` messages of the file stand before."""
        if not self.wanted:
            return
        channels: dict[str, list[int]] = {}
        for channel in chunk.groups:
            source = sources[channel]
            if source.topic.name in self.wanted and source.codec and source.topic.codec.flat:
                channels.setdefault(source.topic.name, []).append(channel)

        for name, own in channels.items():
            if name in self.refused:
                continue
            table = self._tables.get(name) or self._begun(name, sources[own[0]].topic)
            if table and all(table.fits(sources[channel]) for channel in own):
                table.add(chunk, sources, own, before)
            else:
                self.refused.add(name)
                self._tables.pop(name, None)

    def _begun(self, name: str, topic: Topic) -> Table | None:
        """A table for a topic; None where it lacks a field that is asked for."""
        fields = self.wanted[name]
        if not set(fields or ()) <= set(topic.names):
            return None
        self._tables[name] = Table(topic, fields, self.expected[name])
        return self._tables[name]

    def done(self) -> dict[tuple[str, Fields], Rows]:
        """The rows by topic and fields, shape (n,) each, which nobody may change."""
        return {(name, self.wanted[name]): table.done() for name, table in self._tables.items()}


@lru_cache(maxsize=64)  # the recordings of a campaign hold the same messages
def _copy_of(
    codec: Codec, names: tuple[str, ...], row: np.dtype[np.void], compiled: bool
) -> _Copy | _CompiledCopy:
    """By the places of some fields in the messages and in the rows, neighbours joined."""
    record, pieces = codec.record_dtype(MESSAGE_HEAD.size), list[_Piece]()
    split = []
    for name in names:
        if codec.kinds[codec.names.index(name)] == TIME:
            split.append(name)
        else:
            _join(pieces, _piece(name, record, row))
    times = [(name, f"{name}.sec", f"{name}.nanosec") for name in split]

    if compiled and all(piece.kind == piece.row_kind for piece in pieces):
        return _compiled(record, row, pieces, times)
    return _in_numpy(record, row, pieces, times)


def _in_numpy(
    record: np.dtype[np.void],
    row: np.dtype[np.void],
    pieces: list[_Piece],
    times: list[tuple[str, str, str]],
) -> _Copy:
    kinds = [piece.kind for piece in pieces]
    offsets = [piece.offset for piece in pieces]
    parts = [part for _, *both in times for part in both]
    for part in parts:
        kinds.append(_kind(record, part))
        offsets.append(_offset(record, part))

    names = [str(number) for number in range(len(pieces))]
    low = min(offsets)
    return _Copy(
        low,
        _dtype([*names, *parts], kinds, [o - low for o in offsets], None),
        _dtype(names, [p.row_kind for p in pieces], [p.row_offset for p in pieces], row),
        tuple(names),
        tuple(times),
    )


def _compiled(
    record: np.dtype[np.void],
    row: np.dtype[np.void],
    pieces: list[_Piece],
    times: list[tuple[str, str, str]],
) -> _CompiledCopy:
    lengths = [np.dtype(piece.kind).itemsize for piece in pieces]

    return _CompiledCopy(
        record.itemsize,
        tuple((p.offset, p.row_offset, n) for p, n in zip(pieces, lengths, strict=True)),
        tuple(
            (_offset(record, seconds), _offset(row, name), _offset(record, rest))
            for name, seconds, rest in times
        ),
    )


def _piece(name: str, record: np.dtype[np.void], row: np.dtype[np.void]) -> _Piece:
    return _Piece(_kind(record, name), _offset(record, name), _kind(row, name), _offset(row, name))


def _join(pieces: list[_Piece], piece: _Piece) -> None:
    """Add a piece; one that goes on where the last one ends, in record and row, makes it longer."""
    size = np.dtype(piece.kind).itemsize
    if piece.kind != piece.row_kind:
        pieces.append(piece)
        return

    piece = piece._replace(kind=f"V{size}", row_kind=f"V{size}")
    if pieces and pieces[-1].kind == pieces[-1].row_kind:
        last = pieces[-1]
        length = np.dtype(last.kind).itemsize
        if (last.offset + length, last.row_offset + length) == (piece.offset, piece.row_offset):
            kind = f"V{length + size}"
            pieces[-1] = last._replace(kind=kind, row_kind=kind)
            return
    pieces.append(piece)


def _kind(dtype: np.dtype[np.void], name: str) -> str:
    assert dtype.fields is not None
    return dtype.fields[name][0].str


def _offset(dtype: np.dtype[np.void], name: str) -> int:
    assert dtype.fields is not None
    return dtype.fields[name][1]


def _dtype(
    names: list[str], kinds: list[str], offsets: list[int], like: np.dtype[np.void] | None
) -> np.dtype[np.void]:
    """Fields at some offsets; as long as another dtype, or as its fields."""
    ends = [o + np.dtype(k).itemsize for o, k in zip(offsets, kinds, strict=True)]
    size = like.itemsize if like is not None else max(ends, default=0)
    return np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": size})
