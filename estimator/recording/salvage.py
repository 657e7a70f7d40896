"""Read a recording: closed or not, cut at any byte, with flipped bits, or written by somebody else.

Every chunk is unpacked and checked once by `read`; what cannot be trusted is left out and named in
`damage`, one line each. What `messages` and `arrays` give afterwards comes from intact chunks only,
in file order.

Chunks are checked a pile at a time (piles.py). A pile in which anything is not as it should be is
gone through chunk by chunk, which is several times slower and finds what is wrong.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.limits import limits
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import Block, Damaged, Unpacker, records, split, unpack
from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.decoding import MessageHeads, select
from gritd.estimator.recording.definitions import Definitions
from gritd.estimator.recording.mcapfile import LIBRARY, MAGIC, RecordingError, reported
from gritd.estimator.recording.mcapfile import opened as file_opened
from gritd.estimator.recording.message_records import MESSAGE_HEAD
from gritd.estimator.recording.metadata import CHECKSUM, CONFIG, RUN, seal_holds
from gritd.estimator.recording.piles import REACH, ROOM, Pile, alone, opened
from gritd.estimator.recording.received import LogTimes, received
from gritd.estimator.recording.recording import Message, Recording
from gritd.estimator.recording.sequence import ChunkSequence, ranges
from gritd.estimator.recording.tables import NOTHING, Fields, Tables
from gritd.estimator.recording.topics import RAW_TOPICS
from gritd.estimator.recording.walk import Contents, Walk

__all__ = ["Message", "Recording", "RecordingCheck", "opened_to_read", "read", "take_metadata"]

# [bytes] unpacked chunks kept for the next pass; a longer recording is unpacked again
MAX_KEPT = 16 << 20
MAX_LINES = 100
MAX_WASTE = 128 << 20  # [bytes] read and unpacked in vain before giving up
_COST = 100  # [bytes] that could be read in the time one message takes that then is not good
# A chunk takes as long as some thousand messages. So many may have fewer than this, on average.
SMALL_CHUNKS, FEW = 20_000, 4
TRIES = 4  # to check what is left of a pile at once, each after definitions that were new
MAX_PREAMBLES = 1000  # a recording of ours has a few: which channels a chunk holds


def read(
    path: Path | str,
    topics: Iterable[Topic] = RAW_TOPICS,
    tables: Mapping[str, Fields] | None = NOTHING,
) -> Recording:
    """Open a recording and check all of it.

    `topics` are those whose fields the caller relies on; all others are taken as the file defines
    them. `tables` are what `Recording.tables` will be asked for: made in the same pass, a long file
    is unpacked once. None stands for all fields of all topics of an index, unless it is a very long
    file. Raises RecordingError if there is no such file, it is no MCAP file, or one of
    `topics` lacks a field in it.
    """
    path = Path(path)
    recording = Recording(path)
    wanted = Tables(tables)

    known = {topic.name: topic for topic in topics}
    with opened_to_read(path) as file:
        walk = Walk(file, path.stat().st_size)
        times = RecordingCheck(recording, known, wanted).whole(file, walk)

    if len(recording.damage) > MAX_LINES:
        recording.damage[MAX_LINES:] = [f"and {len(recording.damage) - MAX_LINES} more places"]
    recording._tables = wanted.done()
    if not times.good:
        _take_times(recording)
    return recording


@contextmanager
def opened_to_read(path: Path) -> Iterator[BinaryIO]:
    """The file; whatever is wrong with it is a RecordingError that names it."""
    with reported(path, "read"), file_opened(path, buffering=0) as file:
        try:
            yield file
        except RecordingError as error:
            message = str(error)
            raise RecordingError(
                message if message.startswith(str(path)) else f"{path}: {message}"
            ) from None


def take_metadata(recording: Recording, contents: Contents) -> None:
    for name, entries in contents.metadata.items():
        if seal_holds(
            name,
            entries,
            required=contents.library.startswith(LIBRARY) and name.startswith("gritd."),
        ):
            recording.metadata[name] = entries
        else:
            recording.damage.append(f"metadata {name}: its checksum does not hold; ignored")

    recording.repeated = [
        (name, entries) for name, entries in contents.repeated if not name.startswith("gritd.")
    ]

    if contents.library == LIBRARY:
        recording.damage += [
            f"metadata {name} is missing"
            for name in (CONFIG, RUN)
            if name not in recording.metadata
        ]

    config = dict(recording.metadata.get(CONFIG, {}))
    recording.config_yaml = config.pop("yaml", None)
    recording.versions = {key: value for key, value in config.items() if key != CHECKSUM}
    recording.run, wrong = RunInfo.from_entries(recording.metadata.get(RUN, {}))
    recording.damage += [f"metadata {RUN}: {line}" for line in wrong]


def _take_times(recording: Recording) -> None:
    """Another clock of a file whose log times are no times."""
    recording._received, note = received(recording.chunks(), recording.sources)
    recording.notes += [note] if note else ["neither its log times nor its stamps are times"]
    for rows in recording._tables.values():
        rows.flags.writeable = True
        recording._set_times(rows)
        rows.flags.writeable = False


class RecordingCheck:
    """The one pass that decides what is good: fills in a Recording's sources, blocks, counts and
    damage.
    """

    def __init__(self, recording: Recording, known: dict[str, Topic], tables: Tables) -> None:
        self._recording = recording
        self._definitions = Definitions(recording.path, known)
        recording.sources = self._definitions.sources
        self._tables = tables

        self._unpacker = Unpacker()
        self._sequence = ChunkSequence()
        self._seen: set[tuple[int, int]] = set()  # sizes and checksums of chunks
        self._times = LogTimes()  # of another writer's file
        self._numbered = False  # its messages are numbered as ours are
        self._preambles: set[bytes] = {b""}  # definitions that are known, as they stand in a chunk
        self._preamble = b""  # the last of them
        self._line = 0  # where the next line of damage belongs
        self._waste = 0
        self._kept_room = MAX_KEPT
        self._unpacked = self._stored = self._chunks = self._messages = 0

    def whole(self, file: BinaryIO, walk: Walk) -> LogTimes:
        """Raises RecordingError where this is no MCAP file, or one without a field relied on."""
        recording, contents = self._recording, walk.contents
        recording.damage = contents.damage
        walk.begin()
        expected = self._summary(contents.summary)
        self._expect(expected, walk.size)
        self._tables.begin(recording.sources)
        if self._tables.wanted:  # who has the arrays asks no more
            self._kept_room, self._unpacker.last = 0, True

        for pile in _piles(walk, contents.damage):
            self._numbered = contents.library == LIBRARY
            if not self._pile(file, pile):
                break
        else:
            if not contents.headed:
                line = f"byte {len(MAGIC)}: no header: nobody recorded here"
                recording.damage.insert(0, line)

        recording.closed, recording.attachments = contents.closed, contents.attachments
        take_metadata(recording, contents)
        self._count_lost(expected, numbered=contents.library == LIBRARY)
        return self._times

    def _pile(self, file: BinaryIO, pile: Sequence[tuple[Block, int]]) -> bool:
        """Check neighbouring blocks; False where nothing is read from one on. With each stands how
        many lines of damage the walk had found before it.
        """
        damage, more, tries, known = self._recording.damage, 0, TRIES, -1
        for number, (block, before) in enumerate(pile):
            if tries and len(self._preambles) > known:  # at first, and when there is hope again
                if self._together(file, [block for block, _ in pile[number:]]):
                    return True
                tries, known = tries - 1, len(self._preambles)

            self._line = before + more
            if ending := self._ending(block):
                line = f"byte {block.start}: {ending}; the rest is not read"
                damage[self._line :] = [line]  # what the walk found beyond is not looked at
                return False
            try:
                self._block(file, block)
            except Damaged as why:
                self._say(f"byte {block.start}: chunk of {block.stored} bytes skipped: {why}")
                self._waste += block.stored + min(block.size, int(limits().chunk))
            more = self._line - before
        return True

    def _say(self, line: str) -> None:
        self._recording.damage.insert(self._line, line)
        self._line += 1

    def _together(self, file: BinaryIO, blocks: Sequence[Block]) -> bool:
        """Check a pile at once; False, and nothing is taken of it, where anything is not as it
        should be.
        """
        if self._ends_within(blocks):
            return False
        sources = self._recording.sources
        pile = opened(file, blocks, sources, self._unpacker, self._numbered)
        if pile is None or not all(map(self._is_known, pile.preambles)):
            return False

        if self._numbered and not self._sequence.follows(pile.numbers):
            return False

        self._sequence.add(pile.numbers)
        self._count(blocks)
        self._keep(blocks, pile)
        return True

    def _is_known(self, preamble: bytes) -> bool:
        """Whether a chunk's definitions are, to the byte, those of a chunk before or of the
        index.
        """
        if preamble != self._preamble:  # hashing takes longer
            if preamble not in self._preambles:
                if not self._definitions.known(preamble):
                    return False
                self._note(preamble)
            self._preamble = preamble
        return True

    def _note(self, preamble: bytes) -> None:
        if len(self._preambles) < MAX_PREAMBLES:
            self._preambles.add(preamble)

    def _ends_within(self, blocks: Sequence[Block]) -> bool:
        """Whether reading might end inside a pile; `_ending` then says where."""
        bounds = limits()
        unpacked = self._unpacked + integer_sum(block.size for block in blocks)
        stored = self._stored

        return (
            self._waste > MAX_WASTE
            or unpacked > bounds.start + bounds.ratio * stored
            or (
                self._chunks + len(blocks) > SMALL_CHUNKS
                and FEW * (self._chunks + len(blocks)) > self._messages
            )
        )

    def _ending(self, block: Block) -> str:
        """Why nothing is read from here on; '' as a rule."""
        bounds = limits()
        self._count([block])
        if self._waste > MAX_WASTE:
            return "too much damage"
        if self._unpacked > bounds.start + bounds.ratio * self._stored:
            return f"unpacks to more than {bounds.ratio:g} times its size"
        few = FEW * self._chunks > self._messages
        return f"chunks of fewer than {FEW} messages" if self._chunks > SMALL_CHUNKS and few else ""

    def _count(self, blocks: Sequence[Block]) -> None:
        self._chunks += len(blocks)
        self._unpacked += integer_sum(block.size for block in blocks)
        self._stored += integer_sum(
            block.stored + block.indexes[1] - block.indexes[0] for block in blocks
        )

    def _block(self, file: BinaryIO, block: Block) -> None:
        content = unpack(file, block)
        starts, definitions = split(content)
        for opcode, start, end in definitions:
            self._definitions.add(opcode, content[start:end])

        chunk, complaints = select(content, starts, self._recording.sources)
        for complaint in complaints:
            self._say(f"byte {block.start}: {complaint}")

        self._waste += _COST * (len(starts) - len(chunk.starts))
        self._place(block, chunk)
        self._keep([block], alone(chunk))
        if len(starts):
            self._note(content[: int(starts[0])])

    def _place(self, block: Block, chunk: MessageHeads) -> None:
        """Hold the messages' numbers against those before. Raises Damaged for a chunk that stands
        there twice.
        """
        numbers = ranges(chunk)
        if self._numbered and not self._sequence.follows(numbers):
            self._recording.misplaced += 1
            if block.crc and (block.size, block.crc) in self._seen:
                raise Damaged("it stands there twice")
            self._say(
                f"byte {block.start}: chunk of {block.stored} bytes is not in its place: its"
                " messages come after later ones"
            )
        self._sequence.add(numbers)

    def _keep(self, blocks: Sequence[Block], pile: Pile) -> None:
        recording, chunk = self._recording, pile.chunk
        self._kept_room -= len(chunk.content)
        if self._kept_room >= 0:
            recording._kept[len(recording._piles)] = pile
        recording._piles.append(tuple(blocks))

        sizes = np.diff(pile.cuts).tolist()
        recording.unverified += integer_sum(
            size for block, size in zip(blocks, sizes, strict=True) if not block.crc
        )
        for channel, own in chunk.groups.items():
            recording.counts[recording.sources[channel].topic.name] += len(own)
        self._tables.add(chunk, recording.sources, self._messages)
        if self._numbered:
            self._seen.update((block.size, block.crc) for block in blocks)
        else:
            self._times.add(chunk.heads["log_time"])
        self._messages += len(chunk.starts)

    def _summary(self, summary: bytes) -> dict[int, int]:
        """Take the definitions of the summary; return its count of messages by channel, if it has
        one.
        """
        expected: dict[int, int] = {}

        try:
            for opcode, start, end in records(summary):
                if opcode == Opcode.STATISTICS:
                    expected = _channel_counts(summary[start:end])
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._definitions.add(opcode, summary[start:end])
        except Damaged:  # only the first part of a very long summary is read
            pass

        return expected

    def _expect(self, counts: Mapping[int, int], size: int) -> None:
        """Room in the tables for the messages that the index counts, as far as a file of this size
        [bytes] can hold so many.
        """
        most = limits().start + limits().ratio * size
        for channel, count in counts.items():
            source = self._recording.sources.get(channel)
            if source and source.codec and source.codec.flat:
                possible = int(most / (MESSAGE_HEAD.size + source.codec.size))
                self._tables.expected[source.topic.name] += min(count, possible)

    def _count_lost(self, expected: dict[int, int], numbered: bool) -> None:
        """By the count of the index, else by the messages' numbers."""
        recording, counted = self._recording, self._sequence.counts()
        recording.counted = bool(expected)
        if expected:
            differ = [n - counted.get(channel, 0) for channel, n in expected.items()]
            recording.lost = integer_sum(max(0, difference) for difference in differ)
            surplus = integer_sum(max(0, -difference) for difference in differ)
        else:
            recording.lost, surplus = self._sequence.missing if numbered else 0, 0

        if surplus:
            recording.damage.insert(0, f"{surplus} messages more than its index counts")
        if recording.lost:
            recording.damage.insert(0, f"{recording.lost} messages are missing")


def _piles(walk: Walk, damage: Sequence[str]) -> Iterator[list[tuple[Block, int]]]:
    """Neighbouring blocks that are checked together, in file order, each with how many lines of
    damage the walk had found when it came to it.
    """
    pile: list[tuple[Block, int]] = []
    size = 0

    for block in walk.blocks():
        far = pile and block.start + block.stored - pile[0][0].start > REACH
        if pile and (far or size + block.size > ROOM):
            yield pile
            pile, size = [], 0
        pile.append((block, len(damage)))
        size += block.size

    if pile:
        yield pile


def _channel_counts(statistics: bytes) -> dict[int, int]:
    entries = np.frombuffer(statistics[46:], [("channel", "<u2"), ("count", "<u8")])
    return {int(channel): int(count) for channel, count in entries.tolist()}
