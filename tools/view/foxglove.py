"""What the daemon reports, for Foxglove and whatever else speaks its protocol: the topics of a
recording that a report holds, in the recording's own schemas, through foxglove-sdk.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import nan
from typing import TYPE_CHECKING, Any

from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.topics import LOOP_TOPIC, TICK_TOPIC, UPDATE_TOPIC
from gritd.tools.cli.command import FAILED, CommandError
from gritd.tools.service.client import Report

if TYPE_CHECKING:
    import foxglove

REPORTED = {"tick": TICK_TOPIC, "update": UPDATE_TOPIC, "loop": LOOP_TOPIC}  # key of a report


class Relay:
    """A server of its own threads. A client that reads slowly loses the oldest messages."""

    def __init__(self, host: str, port: int) -> None:
        """Raises CommandError where the port is not free."""
        import foxglove

        self._context = context = foxglove.Context()  # the server does not keep it
        try:
            self._server = foxglove.start_server(
                name="gritd", host=host, port=port, context=context
            )
        except RuntimeError:
            expected = "expected a free port (--foxglove N; 0 for any)"
            raise CommandError(f"{host} port {port}: found it taken; {expected}", FAILED) from None
        self._channels = {name: _channel(topic, context) for name, topic in REPORTED.items()}
        self._last = dict.fromkeys(REPORTED, 0)
        self.port = int(self._server.port)

    def take(self, report: Report) -> None:
        """Pass on what is new in a report; one that is not the daemon's raises as Python does."""
        for name, values in messages(report):
            stamp = int(values[0])
            if stamp != self._last[name]:
                self._last[name] = stamp
                data = REPORTED[name].codec.encode(values)
                self._channels[name].log(data, log_time=stamp)

    def close(self) -> None:
        self._server.stop()


def messages(report: Report) -> Iterator[tuple[str, list[Any]]]:
    """Key and values of each message that a report holds, in the order of its topic's fields."""
    for name, topic in REPORTED.items():
        if held := report.get(name):
            yield name, [_value(kind, held[field]) for field, kind, _ in topic.fields]


def _value(kind: str, value: Any) -> Any:
    """JSON has no NaN, and tells no whole number from another."""
    if kind.startswith("float"):
        return nan if value is None else float(value)
    return bool(value) if kind == "bool" else int(value)


def _channel(topic: Topic, context: foxglove.Context) -> foxglove.Channel:
    import foxglove

    schema = foxglove.Schema(name=topic.schema_name, encoding="ros2msg", data=topic.schema.encode())
    return foxglove.Channel(topic.name, message_encoding="cdr", schema=schema, context=context)
