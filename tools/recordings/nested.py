"""Topics of messages within messages as tables: a column for every field, by its path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from gritd.estimator.messages.readings import NS
from gritd.estimator.recording.cdr import Field
from gritd.estimator.recording.decoding import RecordedChannel
from gritd.estimator.recording.salvage import Recording
from gritd.tools.cli.optional import missing
from gritd.tools.messages.decoders import Undecodable, decoder
from gritd.tools.messages.paths import leaves, long, nanoseconds, value_at


@dataclass(frozen=True)
class NestedTopic:
    """A topic whose messages the recording's own reader does not take apart.

    fields: of any of its messages, as those of a topic of fixed fields. left_out: arrays that are
    too long for columns, one line each.
    """

    name: str
    fields: tuple[Field, ...]
    left_out: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for name, _, _ in self.fields)

    def rows(self, recordings: Sequence[Recording], start: int) -> Iterator[tuple[Any, ...]]:
        """Every message: time since `start` [s], then its fields, None where it lacks one."""
        getters = [value_at(name) for name in self.names]
        for time, message in _messages(recordings, self.name):
            yield ((time - start) / NS, *(_plain(get(message)) for get in getters))


def nested(recordings: Sequence[Recording], name: str) -> NestedTopic:
    """A topic by its name, after a look at all of its messages. Raises Undecodable."""
    fields: dict[str, str] = {}
    left_out: dict[str, int] = {}
    for _, message in _messages(recordings, name):
        fields |= {path: _kind(value) for path, value in leaves(message) if path not in fields}
        left_out |= dict(long(message))

    lines = (f"{name}.{path}, an array of {size}" for path, size in left_out.items())
    return NestedTopic(name, tuple((n, kind, "") for n, kind in fields.items()), tuple(lines))


def _messages(recordings: Sequence[Recording], name: str) -> Iterator[tuple[int, Any]]:
    """Receive time [ns] and message, decoded. Raises Undecodable."""
    for recording in recordings:
        known = {
            number: _decoder(source)
            for number, source in recording.sources.items()
            if source.topic.name == name
        }
        for chunk in recording.chunks():
            times = chunk.heads["log_time"]
            own = [(i, c) for c in known.keys() & chunk.groups.keys() for i in chunk.groups[c]]
            for i, channel in sorted(own):
                try:
                    yield int(times[i]), known[channel](chunk.body(int(i)))
                except ValueError as error:
                    raise Undecodable(" ".join(str(error).split())[:120]) from None


def _decoder(source: RecordedChannel) -> Any:
    schema, channel = source.schema, source.channel
    if channel.message_encoding not in ("json", "protobuf") and (how := missing("rosbags")):
        raise Undecodable(how)
    definition = schema.data if schema else b""
    kind, encoding = (schema.name, schema.encoding) if schema else ("", "")
    return decoder(kind, channel.message_encoding, encoding, definition, {})


def _kind(value: Any) -> str:
    return type(value).__name__


def _plain(value: Any) -> Any:
    """As Python writes it: a time in ns, a number of numpy as one of Python."""
    if (time := nanoseconds(value)) is not None:
        return time
    return value.item() if hasattr(value, "item") else value
