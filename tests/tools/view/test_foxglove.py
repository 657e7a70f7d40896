"""`gritd view --foxglove` beside a daemon, read by a websocket client as Foxglove reads it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from itertools import groupby
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("uvicorn", reason="needs gritd[view]")
pytest.importorskip("foxglove", reason="needs gritd[foxglove]")
pytest.importorskip("websockets", reason="needs websockets")
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from websockets.sync.client import connect

from gritd.estimator.recording.topics import LOOP_TOPIC, TICK_TOPIC, UPDATE_TOPIC
from tests.tools.view.process import PATIENCE, viewing
from tests.tools.view.samples import BEGAN, TICK, daemon

TOPICS = {topic.name: topic for topic in (TICK_TOPIC, UPDATE_TOPIC, LOOP_TOPIC)}
SUBPROTOCOL = "foxglove.sdk.v1"
ENOUGH = 3  # messages of each topic


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The channels that are offered by topic, and (topic, log time, message) of some messages."""
    path = tmp_path_factory.mktemp("foxglove") / "gritd.sock"
    options = ("--socket", str(path), "--foxglove", "0")
    with daemon(path), viewing(*options) as (process, _):
        assert process.stdout is not None
        address = process.stdout.readline().split()[1]
        with connect(address, subprotocols=[SUBPROTOCOL]) as client:
            yield listened(client)


def listened(client: Any) -> tuple[dict[str, Any], list[tuple[str, int, SimpleNamespace]]]:
    offered: dict[str, Any] = {}
    while len(offered) < len(TOPICS):
        reported = json.loads(client.recv(PATIENCE))
        if reported["op"] == "advertise":
            offered |= {channel["topic"]: channel for channel in reported["channels"]}

    numbered = list(offered.values())
    wanted = [{"id": n, "channelId": channel["id"]} for n, channel in enumerate(numbered)]
    client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    decoders = [decoder(channel) for channel in numbered]

    messages = []
    while not messages or min(map(len, grouped(messages).values())) < ENOUGH:
        data = client.recv(PATIENCE)
        if isinstance(data, bytes) and data[0] == 1:  # of a subscription: number, log time, message
            number, stamp = (int.from_bytes(data[a:b], "little") for a, b in ((1, 5), (5, 13)))
            messages.append((numbered[number]["topic"], stamp, decoders[number](data[13:])))
    return offered, messages


def decoder(channel: dict[str, Any]) -> Any:
    """By what the channel says of itself, as others decode it."""
    schema = Schema(1, channel["schema"].encode(), channel["schemaEncoding"], channel["schemaName"])
    return DecoderFactory().decoder_for(channel["encoding"], schema)


def grouped(messages: list[Any]) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {name: [] for name in TOPICS}
    for name, some in groupby(messages, key=lambda message: message[0]):
        found[name] += some
    return found


def test_the_topics_have_the_schemas_of_a_recording(heard: Any) -> None:
    offered, _ = heard
    assert offered.keys() == TOPICS.keys()
    for name, channel in offered.items():
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schemaName"] == TOPICS[name].schema_name
        assert channel["schema"] == TOPICS[name].schema


def test_the_messages_are_what_the_daemon_reports(heard: Any) -> None:
    _, messages = heard
    for some in grouped(messages).values():
        stamps = [stamp for _, stamp, _ in some]
        assert stamps == sorted(set(stamps)) and stamps[0] >= BEGAN * 1e9
        assert all(m.stamp.sec * 10**9 + m.stamp.nanosec == stamp for _, stamp, m in some)

    ticks = [message for name, _, message in messages if name == "/tick"]
    assert {tick.cohesion for tick in ticks} == {TICK["cohesion"]}
    assert all(0 <= tick.sequence - 250 * (seconds(tick) - BEGAN) + 1 < 2 for tick in ticks)
    assert all(math.isnan(m.torque_sigmas) for name, _, m in messages if name == "/update")


def seconds(message: SimpleNamespace) -> float:
    return float(message.stamp.sec + 1e-9 * message.stamp.nanosec)
