"""Attachments of other writers' files: looked at, checked and handed on, never taken into memory
whole.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.records import AttachmentIndex

from gritd.estimator.recording.blocks import Damaged, Texts
from gritd.estimator.recording.message_records import RECORD_HEAD

HEAD = 1 << 16  # [bytes] in which name and type of an attachment stand
STEP = 1 << 20  # [bytes] read at once
CRC = 4  # [bytes] at the end


@dataclass(frozen=True)
class AttachmentPlace:
    """Where an attachment's record stands in its file: first byte and length, its head included."""

    start: int
    length: int

    def pieces(self, file: BinaryIO) -> Iterator[bytes]:
        """The record as it is."""
        file.seek(self.start)
        for position in range(0, self.length, STEP):
            yield file.read(min(STEP, self.length - position))

    def checked(self, file: BinaryIO) -> AttachmentIndex:
        """What its index says of it. Raises Damaged where it is not whole."""
        file.seek(self.start + RECORD_HEAD.size)
        fields = Texts(file.read(min(HEAD, self.length - RECORD_HEAD.size)))
        logged, created = fields.integer(8), fields.integer(8)
        name, kind, size = fields.text(), fields.text(), fields.integer(8)
        if RECORD_HEAD.size + fields.position + size + CRC != self.length:
            raise Damaged(f"attachment {name[:40]!r}: its lengths contradict each other")

        running, crc = 0, b""
        for number, piece in enumerate(self.pieces(file)):
            whole = crc + (piece if number else piece[RECORD_HEAD.size :])
            running, crc = zlib.crc32(whole[:-CRC], running), whole[-CRC:]
        stated = int.from_bytes(crc, "little")
        if stated not in (0, running):  # 0: its writer left none
            raise Damaged(f"attachment {name[:40]!r}: its checksum does not hold")
        return AttachmentIndex(self.start, self.length, logged, created, size, name, kind)
