"""The status socket: who may connect, what it says, who is turned away."""

from __future__ import annotations

import json
import math
import os
import socket
import stat
import time

import pytest

from gritd.estimator.daemon.publish import MAX_CLIENTS, Publisher, PublishError, line_of
from gritd.tools.cli.command import CommandError
from gritd.tools.service import client
from tests.drivers.rig import wait_until
from tests.estimator.daemon.reports import REPORT, publishing


@pytest.fixture
def publisher(tmp_path):
    with publishing(tmp_path / "gritd.sock") as publisher:
        yield publisher


def test_the_socket_is_for_user_and_group_only(publisher):
    assert stat.S_IMODE(os.stat(publisher.path).st_mode) == 0o660


def test_reports_are_lines_of_strict_json_ten_a_second_at_most(publisher):
    start = time.monotonic()
    with client.connected(str(publisher.path)) as connection:
        for _, report in zip(range(4), client.reports(connection), strict=False):
            assert report == json.loads(json.dumps(REPORT))
    assert time.monotonic() - start >= 0.3
    assert line_of({"a": [math.nan, math.inf, 1.5]}) == b'{"a":[null,null,1.5]}\n'


def test_a_client_that_does_not_read_is_left_and_others_are_served(publisher, monkeypatch):
    lines = {"text": "x" * 40_000, **REPORT}
    monkeypatch.setattr(publisher, "_report", lambda: lines)
    with client.connected(str(publisher.path)), client.connected(str(publisher.path)) as eager:
        served = iter(client.reports(eager))
        while len(publisher._clients) != 1:
            assert next(served)["pid"] == 1
        assert next(served)["pid"] == 1 and publisher.alive


def test_more_clients_than_there_is_room_for_are_turned_away(publisher):
    connections = []
    for _ in range(MAX_CLIENTS):
        connections.append(client.connected(str(publisher.path)))
        assert next(client.reports(connections[-1]))["pid"] == 1
    with (
        client.connected(str(publisher.path)) as late,
        pytest.raises(CommandError, match="the daemon is busy: 16 readers are connected"),
    ):
        next(client.reports(late))
    assert next(client.reports(connections[0]))["pid"] == 1
    for connection in connections:
        connection.close()


def test_a_socket_that_somebody_removed_is_made_again(publisher):
    with client.connected(str(publisher.path)) as before:
        reports = client.reports(before)
        assert next(reports)["pid"] == 1
        os.unlink(publisher.path)
        assert wait_until(publisher.path.is_socket)
        assert next(reports)["pid"] == 1
    with client.connected(str(publisher.path)) as connection:
        assert next(client.reports(connection))["pid"] == 1


def test_a_socket_that_a_dead_daemon_left_is_replaced_and_a_file_is_not(tmp_path):
    path = tmp_path / "gritd.sock"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(path))
    Publisher(path, lambda: REPORT).close()
    path.write_text("mine")
    with pytest.raises(PublishError, match="a file of this name is there"):
        Publisher(path, lambda: REPORT)
    with pytest.raises(PublishError, match="longer than 107 bytes"):
        Publisher(tmp_path / ("x" * 120), lambda: REPORT)
