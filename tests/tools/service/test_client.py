"""The status socket from the other side."""

from __future__ import annotations

import socket

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.service import client


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
