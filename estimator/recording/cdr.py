"""Topics of a recording: their fields, their ros2msg schema text, and their bytes in
little-endian CDR.

CDR (OMG DDSI-RTPS 10.5, "plain CDR"): four bytes of encapsulation header, then the fields in
order, each aligned to its own size counted from the byte after that header; nothing is padded at
the end. A stamp is an integer of nanoseconds here and `int32 sec, uint32 nanosec` on disk.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.visible import writable

Field = tuple[str, str, str]  # name, ROS type, what it is and its unit
Values = Sequence[Any]
Rows = NDArray[np.void]  # structured

TIME = "builtin_interfaces/Time"
STRING = "string"
ENCAPSULATION = 0x00000100  # bytes 00 01 00 00: plain CDR, little-endian
BILLION = 1_000_000_000

CODES = {  # ROS type -> struct code; its size is its alignment
    "bool": "?",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float32": "f",
    "float64": "d",
}
ALIASES = {"byte": "uint8", "char": "uint8", "builtin_interfaces/msg/Time": TIME, "Time": TIME}
TIME_SCHEMA = "=" * 80 + f"\nMSG: {TIME}\nint32 sec\nuint32 nanosec\n"


@dataclass(frozen=True)
class Topic:
    """A topic of fixed fields. `schema_name` is the ROS name, package/msg/Name.

    Types: builtin_interfaces/Time (an int [ns] on our side), the ROS integers and floats, bool,
    and string. A topic without a string is flat: its messages all have one size, and its arrays
    can be read in bulk.
    """

    name: str
    schema_name: str
    fields: tuple[Field, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(name for name, _, _ in self.fields)

    @cached_property
    def codec(self) -> Codec:
        return Codec(self.fields)

    @cached_property
    def schema(self) -> str:
        """The ros2msg text, comments included, and the definition of Time if it is used."""
        lines = [
            f"{kind} {name}" + (f"  # {doc}" if doc else "") for name, kind, doc in self.fields
        ]
        text = "\n".join(lines) + "\n"
        return text + TIME_SCHEMA if any(kind == TIME for _, kind, _ in self.fields) else text


class Codec:
    """Bytes of one message type. `format` is the struct format (standard sizes, explicit
    padding) of a flat one.
    """

    def __init__(self, fields: Sequence[Field]) -> None:
        for name, kind, _ in fields:
            if kind not in CODES and kind not in (TIME, STRING):
                raise ValueError(
                    f"field {name!r}: type {kind!r} is not one of {TIME}, {STRING},"
                    f" {', '.join(CODES)}"
                )

        self.names = tuple(name for name, _, _ in fields)
        self.kinds = tuple(kind for _, kind, _ in fields)
        self.flat = STRING not in self.kinds
        self.times = tuple(i for i, kind in enumerate(self.kinds) if kind == TIME)
        self._primitives = [
            (name, code) for name, kind, _ in fields for name, code in _primitives(name, kind)
        ]
        self.format, offsets, end = (
            _layout([code for _, code in self._primitives]) if self.flat else ("", [], 0)
        )
        self.size = 4 + end  # [bytes] encapsulation header included; flat only
        self._struct = struct.Struct("<" + self.format)
        self._offsets = offsets

    def flatten(self, values: Values) -> Values:
        """The primitives to pack: every time is split into seconds and nanoseconds."""
        n = len(self.times)
        if self.times == tuple(range(n)):  # stamps first: every topic of ours
            return [part for time in values[:n] for part in divmod(time, BILLION)] + list(
                values[n:]
            )
        split = [divmod(v, BILLION) if i in self.times else (v,) for i, v in enumerate(values)]
        return [primitive for part in split for primitive in part]

    def encode(self, values: Values) -> bytes:
        """One message, encapsulation header included. Raises struct.error where a value does not
        fit its type.
        """
        if self.flat:
            return self._struct.pack(ENCAPSULATION, *self.flatten(values))
        out = bytearray()
        for (_, code), value in zip(self._primitives, self.flatten(values), strict=True):
            out += _encode_one(code, value, len(out))
        return struct.pack("<I", ENCAPSULATION) + bytes(out)

    def decode(self, data: bytes) -> tuple[Any, ...]:
        """The values of one message. Raises ValueError if the bytes are not a message of this
        type.
        """
        if len(data) < 4 or data[:2] != b"\x00\x01":
            raise ValueError("not little-endian CDR")

        try:
            plain = (
                list(self._struct.unpack_from(data)[1:])
                if self.flat
                else self._decode_each(data[4:])
            )
        except (struct.error, IndexError, UnicodeDecodeError) as error:
            raise ValueError(f"not a message of these fields: {error}") from None

        for i in self.times:  # left to right: each join shifts the rest into its final place
            plain[i : i + 2] = [plain[i] * BILLION + plain[i + 1]]

        return tuple(plain)

    def _decode_each(self, body: bytes) -> list[Any]:
        values: list[Any] = []
        position = 0
        for _, code in self._primitives:
            value, position = _decode_one(code, body, position)
            values.append(value)
        return values

    def record_dtype(self, start: int) -> np.dtype[np.void]:
        """The primitives of a flat message whose encapsulation header stands `start` bytes into
        a record.
        """
        return np.dtype(
            {
                "names": [name for name, _ in self._primitives],
                "formats": ["<" + code for _, code in self._primitives],
                "offsets": [start + 4 + offset for offset in self._offsets],
                "itemsize": start + self.size,
            }
        )

    @cached_property
    def table_dtype(self) -> list[tuple[str, str]]:
        """Fields of a decoded row: a time is one int64 [ns]."""
        kinds = (("q" if kind == TIME else CODES[kind]) for kind in self.kinds)
        return [(name, "<" + code) for name, code in zip(self.names, kinds, strict=True)]

    def fill(self, table: Rows, records: Rows) -> None:
        """Copy records of `record_dtype`, shape (n,), into the rows of `table`, shape (n,), by
        name.
        """
        for name in table.dtype.names or ():
            if self.kinds[self.names.index(name)] == TIME:
                table[name] = (
                    records[name + ".sec"].astype(np.int64) * BILLION + records[name + ".nanosec"]
                )
            else:
                table[name] = records[name]


def parse_schema(text: str) -> tuple[Field, ...] | None:
    """The fields of a ros2msg text, or None where it has arrays or nested messages other than
    Time.
    """
    own = re.split(r"^=+\s*$", text, maxsplit=1, flags=re.MULTILINE)[0]
    fields = [_parse_line(line) for line in own.splitlines()]
    kept = tuple(field for field in fields if field is not None)
    readable = all(kind in CODES or kind in (TIME, STRING) for _, kind, _ in kept)
    unique = len({name for name, _, _ in kept}) == len(kept)
    return kept if kept and readable and unique else None


def _parse_line(line: str) -> Field | None:
    code, _, comment = line.partition("#")
    words = code.split()
    if len(words) < 2 or re.match(r"\s*\S+\s+\w+\s*=", code):  # blank, or a constant
        return None
    kind = words[0].partition("<=")[0]  # a bounded string is a string
    return words[1], ALIASES.get(kind, kind), comment.strip()


def _primitives(name: str, kind: str) -> list[tuple[str, str]]:
    if kind == TIME:
        return [(name + ".sec", "i"), (name + ".nanosec", "I")]
    return [(name, CODES.get(kind, "s"))]


def _layout(codes: Sequence[str]) -> tuple[str, list[int], int]:
    """Struct format with explicit padding, the offset of each primitive after the header, and
    the end.
    """
    text, offsets, end = "I", [], 0

    for code in codes:
        size = struct.calcsize("<" + code)
        padding = -end % size
        text += "x" * padding + code
        offsets.append(end + padding)
        end += padding + size

    return text, offsets, end


def _encode_one(code: str, value: Any, position: int) -> bytes:
    if code == "s":
        text: bytes = writable(str(value)).encode() + b"\0"
        return b"\0" * (-position % 4) + struct.pack("<I", len(text)) + text
    return b"\0" * (-position % struct.calcsize("<" + code)) + struct.pack("<" + code, value)


def _decode_one(code: str, body: bytes, position: int) -> tuple[Any, int]:
    size = 4 if code == "s" else struct.calcsize("<" + code)
    position += -position % size
    if code != "s":
        return struct.unpack_from("<" + code, body, position)[0], position + size
    (length,) = struct.unpack_from("<I", body, position)
    end = position + 4 + length
    if length == 0 or end > len(body):
        raise IndexError("a string runs past the end of its message")
    return body[position + 4 : end - 1].decode(), end
