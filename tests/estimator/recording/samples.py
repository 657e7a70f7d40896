"""Recordings for tests: one of ours with every kind of message, and one of another rig."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from mcap.opcode import Opcode
from mcap.writer import Writer

from gritd.estimator.messages.readings import CHANNELS, Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import records
from gritd.estimator.recording.cdr import TIME, Codec, Topic
from gritd.estimator.recording.mcapfile import MAGIC
from gritd.estimator.recording.run_writer import RunWriter

T0 = 1_700_000_000_123_456_789
MIXED = Topic(
    "/mixed",
    "gritd_msgs/msg/Mixed",
    (
        ("stamp", TIME, "first"),
        ("a", "uint8", "one byte, then padding"),
        ("b", "float64", "[N]"),
        ("c", "bool", ""),
        ("d", "uint16", ""),
        ("later", TIME, "a second time"),
        ("e", "float32", ""),
        ("f", "uint8", ""),
        ("g", "uint64", ""),
        ("h", "int32", ""),
    ),
)

FOREIGN = "int32 count\nbuiltin_interfaces/Time stamp\nuint8 quality\nfloat32 voltage\n"
FOREIGN_FIELDS = (
    ("count", "int32", ""),
    ("stamp", "builtin_interfaces/Time", ""),
    ("quality", "uint8", ""),
    ("voltage", "float32", ""),
)


def reading_of(channel: str, i: int) -> Reading:
    values: dict[str, object] = {"count": i * 977 - 50, "volts": i / 7.0, "celsius": 20.0 + i / 3.0}
    value = (
        tuple(i + k / 3.0 for k in range(6))
        if channel == "wrench"
        else values[CHANNELS[channel][0]]
    )
    return Reading(T0 + i * 1_000_003, channel, value, T0 + i * 1_000_003 + 250)  # type: ignore[arg-type]


def mixed_values(i: int) -> tuple[object, ...]:
    return (T0 + i, i % 256, i * 0.1, i % 3 == 0, i, T0 - i, i / 4.0, 255 - i % 256, 2**63 + i, -i)


def write_sample(
    path: Path, count: int = 40, close: bool = True, compression: str = "zstd", every: int = 10
) -> list[tuple[str, int, tuple]]:
    """Every raw topic, /mixed and /log, several chunks; returns what was written, in order."""
    writer = RunWriter(
        path,
        [MIXED],
        "wheel: {radius: 0.072}\n",
        RunInfo("sample", 40.0, notes="ä"),
        compression=compression,
    )
    written: list[tuple[str, int, tuple]] = []
    for i in range(count):
        for channel in CHANNELS:
            reading = reading_of(channel, i)
            writer.reading(reading)
            value = reading.value if isinstance(reading.value, tuple) else (reading.value,)
            written.append((f"/raw/{channel}", reading.received, (reading.stamp, *value)))
        written.append(("/mixed", T0 + i, mixed_values(i)))
        writer.message(*written[-1])
        if i % every == every - 1:
            written.append(
                ("/log", T0 + i, (T0 + i, 30, "sync", f"reading {i} late, θ₁", "", "", 7))
            )
            writer.message(*written[-1])
            writer.flush()
    if close:
        writer.close()
    return written


def write_foreign(path: Path, count: int = 500, schema: str = FOREIGN, **options: object) -> None:
    """A rig of its own: fields in another order and of other widths, extra topics, the mcap
    library's writer.
    """
    with open(path, "wb") as file:
        writer = Writer(file, **options)  # type: ignore[arg-type]
        writer.start()
        encoder = writer.register_schema("rig/msg/Encoder", "ros2msg", schema.encode())
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        wheel = writer.register_channel("/raw/wheel_encoder", "cdr", encoder)
        note = writer.register_channel("/note", "cdr", text)
        blob = writer.register_channel("/blob", "json", 0)
        codec, string = Codec(FOREIGN_FIELDS), Codec((("data", "string", ""),))
        for i in range(count):
            t = T0 + i * 10**6
            writer.add_message(wheel, t, codec.encode((-i, t - 5, 3, 1.5)) + bytes(i % 4), t)
            if i % 100 == 0:
                writer.add_message(note, t, string.encode((f"load {i}",)), t)
                writer.add_message(blob, t, b'{"a": 1}', t)
        writer.finish()


def pieces(path: Path) -> tuple[bytes, list[bytes], bytes]:
    """What stands before the chunks, each chunk with its indexes, and the rest."""
    data = path.read_bytes()
    body = data[len(MAGIC) : -len(MAGIC)]
    places = [(opcode, start - 9, end) for opcode, start, end in records(body)]
    first = next(start for opcode, start, _ in places if opcode == Opcode.CHUNK)
    last = next(start for opcode, start, _ in places if opcode == Opcode.DATA_END)
    cuts = [start for opcode, start, _ in places if opcode == Opcode.CHUNK] + [last]
    chunks = [body[a:b] for a, b in pairwise(cuts)]
    return data[: len(MAGIC) + first], chunks, data[len(MAGIC) + last :]
