"""The lines of a text file, plain or compressed, in any usual encoding, block by block."""

from __future__ import annotations

import bz2
import codecs
import gzip
import io
import lzma
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Protocol, cast

import zstandard

from gritd.estimator.recording.mcapfile import opened
from gritd.tools.importers.files import RigFileError

MAX_LINE = 1 << 24  # [bytes]
FEED = 1 << 12  # [bytes] that are unpacked at once: a few of them may become 100 MB
MAX_WINDOW = 1 << 27  # [bytes] that unpacking keeps
BLOCK = 1 << 20  # [characters] that are read at once
QUOTED = 20  # lines over which a quote may stay open
BEGIN = 1 << 16  # [bytes] that tell what a file is
MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
CONTROL = re.compile(r"[\x01-\x08\x0e-\x19\x1b-\x1f]")  # characters that no text has
BINARY = 0.002  # share of them beyond which a file is none
DAMAGE = (
    OSError,
    EOFError,
    NotImplementedError,
    zlib.error,
    lzma.LZMAError,
    zstandard.ZstdError,
    zipfile.BadZipFile,
)


class Readable(Protocol):
    def read1(self, size: int, /) -> bytes:
        """Some of the next bytes, up to so many; none at the end."""


class TextFile:
    """An open text file. `cut` says why it ends too early, or is ''; `size` [bytes] is as stored,
    `packed` whether that is compressed.
    """

    def __init__(self, path: Path, packed: BinaryIO, unpacked: Readable) -> None:
        self._packed, self.packed = packed, unpacked is not cast(Readable, packed)
        self.size = path.stat().st_size
        self._bytes = _Bounded(path, unpacked)
        begin = self._bytes.peeked(BEGIN)
        self._lines = io.TextIOWrapper(
            io.BufferedReader(self._bytes, BLOCK), _encoding(begin), "gritd-cp1252"
        )
        letters = begin.decode(_encoding(begin), "gritd-cp1252")
        if len(CONTROL.findall(letters)) > BINARY * len(letters):
            raise RigFileError(f"{path}: found bytes that are no text; expected a text file")

    @property
    def cut(self) -> str:
        return self._bytes.cut

    @property
    def position(self) -> int:
        """Bytes of the file that were read, packed."""
        return self._packed.tell()

    def block(self) -> list[str]:
        """The next lines, each with its end; none behind the last. Raises RigFileError."""
        lines = self._lines.readlines(BLOCK)
        for _ in range(QUOTED):
            if "".join(lines).count('"') % 2 == 0 or not (more := self._lines.readline()):
                break
            lines.append(more)
        return lines


@contextmanager
def text_file(path: Path) -> Iterator[TextFile]:
    """Opens a text file. Raises RigFileError."""
    try:
        with opened(path) as packed:
            yield TextFile(path, packed, _unpacked(path, packed))
    except DAMAGE as error:
        raise _unreadable(path, error) from None


def _unreadable(path: Path, error: Exception) -> RigFileError:
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return RigFileError(
        f"{path}: cannot be read: {' '.join(reason.split())[:80]}; "
        "expected a text file, plain or compressed"
    )


def _encoding(begin: bytes) -> str:
    """What a file is written in. Without a mark it is UTF-8, or UTF-16 where every other byte is 0;
    bytes that are no UTF-8 are read as Windows-1252.
    """
    for mark, name in MARKS.items():
        if begin.startswith(mark):
            return name
    even, odd = begin[0:1000:2], begin[1:1000:2]
    for zeros, letters, name in ((odd, even, "utf-16-le"), (even, odd, "utf-16-be")):
        if len(odd) > 4 and zeros.count(0) > 0.8 * len(zeros) and not letters.count(0):
            return name
    return "utf-8"


def _windows(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode("cp1252", "replace"), error.end


codecs.register_error("gritd-cp1252", _windows)


class _Bounded(io.RawIOBase):
    """Bytes, as long as no line is longer than any of a log; several zero bytes are one. What is
    damaged ends them.
    """

    def __init__(self, path: Path, file: Readable) -> None:
        self._path, self._file, self._rest, self._line = path, file, b"", 0
        self.cut = ""

    def readable(self) -> bool:
        return True

    def peeked(self, size: int) -> bytes:
        """The first bytes, which are read again."""
        while len(self._rest) < size and (data := self._next(size)):
            self._rest += data
        return self._rest[:size]

    def readinto(self, buffer: object) -> int:
        room = memoryview(cast(bytearray, buffer))
        data = self._rest[: len(room)] or self._next(len(room))
        self._rest = self._rest[len(room) :]
        if b"\0\0\0" in data:  # not of UTF-16
            data = re.sub(rb"\0\0\0+", b"\0\0", data)
        self._check(data)
        room[: len(data)] = data
        return len(data)

    def _next(self, size: int) -> bytes:
        """What can be read without losing it to damage behind it."""
        try:
            return self._file.read1(size)
        except DAMAGE as error:
            self.cut = str(error) or type(error).__name__
            return b""

    def _check(self, data: bytes) -> None:
        """Raises RigFileError within a line that does not end."""
        end = max(data.rfind(b"\n"), data.rfind(b"\r"))
        self._line = self._line + len(data) if end < 0 else len(data) - end
        if self._line > MAX_LINE:
            raise RigFileError(f"{self._path}: found a line of more than {MAX_LINE} bytes")


# --- compression ---


def _unpacked(path: Path, file: BinaryIO) -> Readable:
    """The content of a file, by how it begins, not by its name. Raises RigFileError."""
    begin = file.read(8)
    file.seek(0)
    kind = next((open_ for magic, open_ in PACKED.items() if begin.startswith(magic)), None)
    return cast(Readable, file) if kind is None else kind(path, file)


def _zip(path: Path, file: BinaryIO) -> Readable:
    """The one file of an archive. Raises RigFileError."""
    archive = zipfile.ZipFile(file)
    names = [
        name
        for name in archive.namelist()
        if not name.endswith("/") and not name.startswith("__MACOSX/")
    ]
    if len(names) != 1:
        raise RigFileError(
            f"{path}: found {len(names)} files in the archive; expected one: unpack it, and name "
            "the file that is meant"
        )
    if archive.getinfo(names[0]).flag_bits & 1:
        raise RigFileError(f"{path}: found a file with a password; expected one without")
    return cast(Readable, archive.open(names[0]))


class _Zst:
    """The content of a zstd file, frame after frame. One that ends within a frame is reported, as
    Python's own readers tell it.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_WINDOW)
        self._frame: zstandard.ZstdDecompressionObj | None = None
        self._rest = b""

    def read1(self, size: int) -> bytes:
        while not self._rest:
            packed = self._file.read(FEED)
            if not packed and self._frame is not None:
                raise EOFError("the file ends within its packed data")
            if not packed:
                return b""
            self._rest = self._unpacked(packed)
        data, self._rest = self._rest[:size], self._rest[size:]
        return data

    def _unpacked(self, packed: bytes) -> bytes:
        made = b""
        while packed:
            frame = self._frame or self._unpacker.decompressobj()
            made += frame.decompress(packed)
            packed = frame.unused_data
            self._frame = None if frame.eof else frame
        return made


PACKED: dict[bytes, Callable[[Path, BinaryIO], Readable]] = {
    b"\x1f\x8b": lambda _, file: cast(Readable, gzip.GzipFile(fileobj=file)),
    b"BZh": lambda _, file: cast(Readable, bz2.BZ2File(file)),
    b"\xfd7zXZ\x00": lambda _, file: cast(Readable, lzma.LZMAFile(file)),  # noqa: SIM115
    b"\x28\xb5\x2f\xfd": lambda _, file: _Zst(file),
    b"PK\x03\x04": _zip,
}
