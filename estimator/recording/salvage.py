"""Read a recording: closed or not, cut at any byte, with flipped bits, or written by somebody else.

Every chunk is unpacked and checked once by `read`; what cannot be trusted is left out and named in
`damage`, one line each. What `messages` and `arrays` give afterwards comes from intact chunks only,
in file order.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode

from gritd.estimator.limits import limits
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import Block, Damaged, records, split, unpack
from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.decoding import Chunk, select
from gritd.estimator.recording.definitions import Definitions
from gritd.estimator.recording.mcapfile import LIBRARY, RecordingError, opened, reported
from gritd.estimator.recording.metadata import CHECKSUM, CONFIG, RUN, seal_holds
from gritd.estimator.recording.recording import Message, Recording
from gritd.estimator.recording.sequence import Sequence
from gritd.estimator.recording.topics import RAW_TOPICS
from gritd.estimator.recording.walk import Contents, Walk

__all__ = ["Message", "Recording", "read"]

# [bytes] unpacked chunks kept for the next pass; a longer recording is unpacked again
MAX_KEPT = 16 << 20
MAX_LINES = 100
MAX_WASTE = 128 << 20  # [bytes] read and unpacked in vain before giving up
_COST = 100  # [bytes] that could be read in the time one message takes that then is not good
# A chunk takes as long as some thousand messages. So many may have fewer than this, on average.
SMALL_CHUNKS, FEW = 20_000, 4


def read(path: Path | str, topics: Iterable[Topic] = RAW_TOPICS) -> Recording:
    """Open a recording and check all of it.

    `topics` are those whose fields the caller relies on; all others are taken as the file defines
    them. Raises RecordingError if there is no such file, it is no MCAP file, or one of `topics`
    lacks a field in it.
    """
    path = Path(path)
    recording = Recording(path)
    with reported(path, "read"), opened(path) as file:
        try:
            walk = Walk(file, path.stat().st_size)
            _Check(recording, {topic.name: topic for topic in topics}).whole(file, walk)
        except RecordingError as error:
            message = str(error)
            raise RecordingError(
                message if message.startswith(str(path)) else f"{path}: {message}"
            ) from None
    if len(recording.damage) > MAX_LINES:
        recording.damage[MAX_LINES:] = [f"and {len(recording.damage) - MAX_LINES} more places"]
    return recording


def _take_metadata(recording: Recording, contents: Contents) -> None:
    for name, entries in contents.metadata.items():
        if seal_holds(
            name,
            entries,
            required=contents.library.startswith(LIBRARY) and name.startswith("gritd."),
        ):
            recording.metadata[name] = entries
        else:
            recording.damage.append(f"metadata {name}: its checksum does not hold; ignored")
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


class _Check:
    """The one pass that decides what is good: fills in a Recording's sources, blocks, counts and
    damage.
    """

    def __init__(self, recording: Recording, known: dict[str, Topic]) -> None:
        self._recording = recording
        self._definitions = Definitions(recording.path, known)
        recording.sources = self._definitions.sources
        self._sequence = Sequence()
        self._waste = 0
        self._kept_room = MAX_KEPT
        self._unpacked = self._stored = self._chunks = self._messages = 0

    def whole(self, file: BinaryIO, walk: Walk) -> None:
        """Raises RecordingError where this is no MCAP file, or one without a field relied on."""
        recording, contents = self._recording, walk.found
        recording.damage = contents.damage
        walk.begin()
        expected = self._summary(contents.summary)

        for block in walk.blocks():
            if ending := self._ending(block):
                recording.damage.append(f"byte {block.start}: {ending}; the rest is not read")
                break
            try:
                self._block(file, block, numbered=contents.library == LIBRARY)
            except Damaged as why:
                recording.damage.append(
                    f"byte {block.start}: chunk of {block.stored} bytes skipped: {why}"
                )
                self._waste += block.stored + min(block.size, int(limits().chunk))

        recording.closed, recording.attachments = contents.closed, contents.attachments
        _take_metadata(recording, contents)
        self._count_lost(expected, numbered=contents.library == LIBRARY)

    def _ending(self, block: Block) -> str:
        """Why nothing is read from here on; '' as a rule."""
        bounds = limits()
        self._chunks += 1
        self._unpacked += block.size
        self._stored += block.stored + block.index[1] - block.index[0]
        if self._waste > MAX_WASTE:
            return "too much damage"
        if self._unpacked > bounds.start + bounds.ratio * self._stored:
            return f"unpacks to more than {bounds.ratio:g} times its size"
        few = FEW * self._chunks > self._messages
        return f"chunks of fewer than {FEW} messages" if self._chunks > SMALL_CHUNKS and few else ""

    def _block(self, file: BinaryIO, block: Block, numbered: bool) -> None:
        content = unpack(file, block)
        starts, definitions = split(file, block, content)
        for opcode, start, end in definitions:
            self._definitions.add(opcode, content[start:end])
        chunk, complaints = select(content, starts, self._recording.sources)
        self._recording.damage += [f"byte {block.start}: {complaint}" for complaint in complaints]
        self._waste += _COST * (len(starts) - len(chunk.starts))
        self._place(block, chunk, numbered)
        self._keep(block, chunk)

    def _place(self, block: Block, chunk: Chunk, numbered: bool) -> None:
        """Hold the messages' numbers against those before. Raises Damaged for a chunk that stands
        there twice.
        """
        numbers = chunk.heads["sequence"]
        ranges = {
            channel: (int(numbers[own[0]]), int(numbers[own[-1]]), len(own))
            for channel, own in chunk.groups.items()
        }
        if numbered and self._sequence.repeated(ranges):
            self._recording.misplaced += 1
            raise Damaged("it stands there twice")
        if not self._sequence.add(ranges) and numbered:
            self._recording.misplaced += 1
            self._recording.damage.append(
                f"byte {block.start}: chunk of {block.stored} bytes is not in its place: its"
                " messages come after later ones"
            )

    def _keep(self, block: Block, chunk: Chunk) -> None:
        recording = self._recording
        self._kept_room -= len(chunk.content)
        if self._kept_room >= 0:
            recording._kept[len(recording._blocks)] = chunk
        recording._blocks.append(block)
        recording.unverified += 0 if block.crc else len(chunk.starts)
        self._messages += len(chunk.starts)
        for channel, own in chunk.groups.items():
            recording.counts[recording.sources[channel].topic.name] += len(own)

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

    def _count_lost(self, expected: dict[int, int], numbered: bool) -> None:
        """By the count of the index, else by the messages' numbers."""
        recording, counted = self._recording, self._sequence.counts()
        recording.counted = bool(expected)
        if expected:
            differ = [n - counted.get(channel, 0) for channel, n in expected.items()]
            recording.lost = sum(max(0, difference) for difference in differ)
            surplus = sum(max(0, -difference) for difference in differ)
        else:
            recording.lost, surplus = self._sequence.missing if numbered else 0, 0

        if surplus:
            recording.damage.insert(0, f"{surplus} messages more than its index counts")
        if recording.lost:
            recording.damage.insert(0, f"{recording.lost} messages are missing")


def _channel_counts(statistics: bytes) -> dict[int, int]:
    entries = np.frombuffer(statistics[46:], [("channel", "<u2"), ("count", "<u8")])
    return {int(channel): int(count) for channel, count in entries.tolist()}
