"""ROS bags: .bag, .db3, .mcap and folders of them, and the MCAP files of others."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.recording.salvage import read as salvaged
from gritd.tools.cli.progress import Progress
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import check_size, reading
from gritd.tools.importers.series.columns import Column, SeriesTable, Wanted
from gritd.tools.importers.series.times import NONE, NS, Nanoseconds
from gritd.tools.messages.decoders import Decoder, Undecodable, decoder
from gritd.tools.messages.paths import Getter, getter, leaves, number, stamp

FAR = 60.0  # [s] stamps of headers that are farther off the times of receipt are of another clock
GOOD = 0.99  # share of the times that are some, of a clock that can be used
TOPICS = 10  # that are read to the number of rows that is enough
STEP = 5000  # messages between two signs of life


@dataclass
class _Topic:
    """What is read of one topic, message by message."""

    getters: dict[str, Getter]
    decode: Decoder
    found: list[str] = field(default_factory=list)  # all numbers of the first message
    stamps: array[int] = field(default_factory=lambda: array("q"))  # of headers [ns]; 0 without
    logged: array[int] = field(default_factory=lambda: array("q"))  # [ns]
    published: array[int] = field(default_factory=lambda: array("q"))  # [ns]
    values: list[array[float]] = field(default_factory=list)
    unlike: int = 0  # messages that do not fit their type

    def add(self, message: Any, logged: int, published: int) -> None:
        self.stamps.append(stamp(message) or 0)
        self.logged.append(logged)
        self.published.append(published)
        for get, values in zip(self.getters.values(), self.values, strict=True):
            values.append(get(message))


class _Message(NamedTuple):
    """One message as a file holds it. Times [ns] are those of receipt and of publishing."""

    topic: str
    data: bytes
    logged: int
    published: int


def read_mcap(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The fields of each topic's messages, `/topic.field`. Raises RigFileError."""
    try:
        recording = salvaged(path, topics=())
    except RecordingError as error:
        raise RigFileError(str(error)) from None

    decoders, refused = {}, {}
    for source in recording.sources.values():
        schema, channel = source.schema, source.channel
        kind, encoding = (schema.name, schema.encoding) if schema else ("", "")
        definition = schema.data if schema else b""
        try:
            decoders[channel.topic] = decoder(
                kind, channel.message_encoding, encoding, definition, {}
            )
        except Undecodable as why:
            refused[channel.topic] = str(why)

    _check(path, refused, wanted)
    asked = {topic for topic in decoders if _asks(wanted, topic)}
    total = sum(recording.counts[topic] for topic in asked)
    tables = _tables(path, _of_mcap(recording, asked), decoders, wanted, total)
    lines = [f"{path.name}: {line}" for line in (*recording.damage, *recording.notes)]
    return _noted(tables, [f"{topic}: {why}" for topic, why in refused.items()], lines)


def _of_mcap(recording: Recording, asked: set[str]) -> Iterator[_Message]:
    for chunk in recording.chunks():
        for channel, own in chunk.groups.items():
            topic = recording.sources[channel].topic.name
            if topic not in asked:
                continue
            logged, published = (
                chunk.heads[name][own].astype(np.int64).tolist()
                for name in ("log_time", "publish_time")
            )
            for i, at, sent in zip(own.tolist(), logged, published, strict=True):
                yield _Message(topic, chunk.body(i), at, sent)


def read_bag(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The fields of each topic's messages, `/topic.field`. Raises RigFileError."""
    if path.is_dir() and not (path / "metadata.yaml").exists():
        raise RigFileError(f"{path}: found no metadata.yaml; expected the folder of a ROS 2 bag")
    module = "rosbags.rosbag1" if path.suffix == ".bag" else "rosbags.rosbag2"
    own = {} if path.suffix == ".bag" else _definitions(path)

    with reading(path, "a ROS bag"), import_module(module).Reader(path) as bag:
        decoders, refused = {}, {}
        for connection in bag.connections:
            try:
                decoders[connection.topic] = _decoder(connection, path.suffix == ".bag", own)
            except Undecodable as why:
                refused[connection.topic] = str(why)

        _check(path, refused, wanted)
        asked = [c for c in bag.connections if c.topic in decoders and _asks(wanted, c.topic)]
        messages = bag.messages(asked) if asked else ()
        found = (_Message(c.topic, data, time, time) for c, time, data in messages)
        tables = _tables(path, found, decoders, wanted, sum(c.msgcount for c in asked))

    return _noted(tables, [f"{topic}: {why}" for topic, why in refused.items()], [])


def _decoder(connection: Any, first: bool, own: Mapping[str, str]) -> Decoder:
    """first: of a bag of ROS 1."""
    formats = import_module("rosbags.interfaces").MessageDefinitionFormat
    schema = {formats.MSG: "ros2msg", formats.IDL: "ros2idl"}.get(connection.msgdef.format, "")
    definition = connection.msgdef.data.encode()
    return decoder(connection.msgtype, "ros1" if first else "cdr", schema, definition, own)


def _definitions(path: Path) -> dict[str, str]:
    """The message files beside a bag, package/msg/Name.msg, by the types' names: older bags of ROS
    2 hold no definitions.
    """
    folder = path if path.is_dir() else path.parent
    found = [*folder.glob("*/msg/*.msg"), *folder.parent.glob("*/msg/*.msg")]
    return {
        f"{file.parts[-3]}/msg/{file.stem}": file.read_text(encoding="utf-8", errors="replace")
        for file in found
    }


# --- messages to tables ---


def _asks(wanted: Wanted, topic: str) -> bool:
    """Whether any field of a topic may be wanted; a name without a topic may be of any."""
    if wanted.names is None:
        return True
    return any(name.startswith(f"{topic}.") or name[:1] != "/" for name in wanted.names)


def _check(path: Path, refused: Mapping[str, str], wanted: Wanted) -> None:
    """Raises RigFileError where a topic is wanted that cannot be read."""
    for topic, why in refused.items():
        if wanted.names and any(name.startswith(f"{topic}.") for name in wanted.names):
            raise RigFileError(f"{path}: {topic}: {why}")


def _tables(
    path: Path,
    messages: Iterable[_Message],
    decoders: Mapping[str, Decoder],
    wanted: Wanted,
    total: int,
) -> list[SeriesTable]:
    """A table a topic of which anything is wanted. Raises RigFileError."""
    topics: dict[str, _Topic] = {}
    with Progress(f"reading {path.name}", total) as progress:
        for count, message in enumerate(messages, start=1):
            if wanted.rows and count > TOPICS * wanted.rows:
                break
            _take(topics, message, decoders, wanted)
            if count % STEP == 0:
                progress.advance(STEP)
                check_size(path, _size(topics))

    check_size(path, _size(topics))
    made = (_table(path, name, topic) for name, topic in topics.items() if topic.logged)
    tables = [each for each in made if each.columns]
    if not tables:
        raise RigFileError(f"{path}: found no messages with numbers; expected some to be mapped")
    return tables


def _size(topics: Mapping[str, _Topic]) -> int:
    """How many numbers are kept."""
    return sum(len(topic.logged) * len(topic.values) for topic in topics.values())


def _take(
    topics: dict[str, _Topic], message: _Message, decoders: Mapping[str, Decoder], wanted: Wanted
) -> None:
    """Read what is wanted of one message."""
    topic = topics.get(message.topic)
    if topic is None:
        topic = topics[message.topic] = _Topic({}, decoders[message.topic])
    elif (not topic.getters and topic.logged) or len(topic.logged) == wanted.rows:
        return

    try:
        decoded = topic.decode(message.data)
    except ValueError:
        topic.unlike += 1
        return

    if not topic.logged:
        topic.found = [path for path, value in leaves(decoded) if not np.isnan(number(value))]
        asked = _paths(message.topic, topic.found, wanted)
        topic.getters = {path: getter(path) for path in asked}
        topic.values = [array("d") for _ in topic.getters]
    topic.add(decoded, message.logged, message.published)


def _paths(topic: str, found: Sequence[str], wanted: Wanted) -> list[str]:
    """The fields that are wanted of a topic: of a topic that is named, also those that its first
    message lacks.
    """
    if wanted.names is None:
        return [path for path in found if not path.startswith("header.")]
    full = [n.removeprefix(f"{topic}.") for n in wanted.names if n.startswith(f"{topic}.")]
    return [*full, *(path for path in found if path in wanted.names and path not in full)]


def _table(path: Path, name: str, topic: _Topic) -> SeriesTable:
    arrays = [np.frombuffer(values) for values in topic.values]
    clock, notes = _clock(topic)
    if topic.unlike:
        notes.append(f"{topic.unlike} messages do not fit their type and are left out")

    columns = {
        f"{name}.{path}": Column(numbers)
        for path, numbers in zip(topic.getters, arrays, strict=True)
        if path in topic.found or not np.all(np.isnan(numbers))
    }
    lines = tuple(f"{name}: {note}" for note in notes)
    return SeriesTable(path, columns, group=name, clock=clock, notes=lines)


def _clock(topic: _Topic) -> tuple[Nanoseconds | None, list[str]]:
    """When the messages were measured [ns], shape (n,), NONE where that is not known: by their
    headers, else when they were received, else published; None where none of them says.
    """
    stamped, logged, published = (
        np.frombuffer(times, np.int64) for times in (topic.stamps, topic.logged, topic.published)
    )
    by_header, by_log = _is_clock(stamped), _is_clock(logged)
    off = float(np.median(stamped - logged)) / NS if by_header and by_log else 0.0

    if by_header and abs(off) < FAR:
        notes = (
            [] if by_log else ["its log times are no times; taken are the stamps of the headers"]
        )
        return _known(stamped), notes
    if by_log:
        far = f"the stamps of its headers are {off:.4g} s off its log times, which are taken"
        return _known(logged), [far] if by_header else []
    if _is_clock(published):
        return _known(published), ["its log times are no times; taken are those of publishing"]
    return None, ["neither its log times nor its headers are times"]


def _is_clock(times: Nanoseconds) -> bool:
    """Whether nearly all are later than 1970, and not all the same."""
    return bool(np.mean(times > 0) >= GOOD and (times.size == 1 or np.ptp(times) > 0))


def _known(times: Nanoseconds) -> Nanoseconds:
    return np.where(times > 0, times, NONE)


def _noted(
    tables: list[SeriesTable], refused: Iterable[str], damage: Iterable[str]
) -> list[SeriesTable]:
    """The tables, the first with what the whole file has to tell."""
    first = tables[0]
    notes = (*damage, *(f"{line}; left out" for line in refused), *first.notes)
    return [replace(first, notes=notes), *tables[1:]]
