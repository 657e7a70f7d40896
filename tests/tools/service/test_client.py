"""The status socket from the other side."""

from __future__ import annotations

import socket

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.service import client
from tests.estimator.daemon.reports import publishing


@pytest.mark.parametrize("line", [b"hello\n", b"[]\n", b"{}\n", b"[" * 5000 + b"\n"])
def test_what_is_no_daemon_is_one_line(tmp_path, line):
    path = tmp_path / "other"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen()
        connection = client.connected(str(path))
        other.accept()[0].sendall(line)
        with connection, pytest.raises(CommandError, match="no gritd"):
            next(client.reports(connection))


@pytest.fixture
def alone(monkeypatch, tmp_path):
    """No daemon at the usual places, and none of the computer's: its table is a file of ours."""
    monkeypatch.setattr(client, "PLACES", (tmp_path / "usual" / client.SOCKET,))
    monkeypatch.setattr(client, "KERNEL_TABLE", tmp_path / "unix")
    return tmp_path


def in_table(folder, *paths):
    lines = [f"0000: 00000002 00000000 00010000 0001 01 {n} {p}" for n, p in enumerate(paths)]
    (folder / "unix").write_text("\n".join(["Num RefCount Protocol Flags Type St Inode", *lines]))


def test_the_running_daemon_is_found_wherever_its_socket_is(alone):
    path = alone / "demo" / client.SOCKET
    path.parent.mkdir()
    in_table(alone, "/run/other.sock", path, path)
    with publishing(path), client.connected(None) as connection:
        assert next(client.reports(connection))["pid"] == 1


def test_without_a_daemon_and_with_two_it_says_so(alone):
    with pytest.raises(CommandError, match="no daemon answers"):
        client.connected(None)

    paths = [alone / name / client.SOCKET for name in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
    in_table(alone, *paths, alone / "gone" / client.SOCKET)
    with (
        publishing(paths[0]),
        publishing(paths[1]),
        pytest.raises(CommandError, match=f"found 2 daemons.*--socket.*{paths[0]}, {paths[1]}"),
    ):
        client.connected(None)
