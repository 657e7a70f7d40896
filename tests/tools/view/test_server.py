"""`gritd view` as a process: attacked, it touches nothing but itself, and answers again."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from typing import Any
from urllib.request import urlopen

import pytest

pytest.importorskip("uvicorn", reason="needs gritd[view]")
from tests.tools.view.process import PATIENCE, answers, place, viewing
from tests.tools.view.samples import daemon, report


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, str, list[float]]]:
    """A view, its address, and when its daemon made a report."""
    path, made = tmp_path_factory.mktemp("view") / "gritd.sock", []

    def noted(at: float) -> dict[str, object]:
        made.append(at)
        return report(at)

    with daemon(path, noted), viewing("--socket", str(path)) as (process, address):
        assert answers(address)
        yield process, address, made


def goes_on(made: list[float]) -> bool:
    """Whether the daemon makes reports."""
    before, end = len(made), time.monotonic() + PATIENCE
    while len(made) < before + 3 and time.monotonic() < end:
        time.sleep(0.05)
    return len(made) >= before + 3


HEAD = b" HTTP/1.1\r\nHost: localhost\r\n"
SAID = (
    b"",  # idle
    b"GET /live" + HEAD + b"\r\n",  # and never reads
    b"GET /" + HEAD + b"X: " + b"x" * 60_000,  # endless
    b"\x16\x03\x01\x00nonsense\r\n\r\n",
)


def test_attacked_it_leaves_the_daemon_alone_and_answers_again(watched: Any) -> None:
    process, address, made = watched
    with ExitStack() as held:
        for number in range(400):
            client = held.enter_context(socket.socket())
            client.settimeout(5.0)
            with suppress(OSError):  # refused, as it may be
                client.connect(place(address))
                client.sendall(SAID[number % len(SAID)])

        assert goes_on(made) and process.poll() is None
    assert answers(address)


def test_frozen_it_does_not_hold_the_daemon_up(watched: Any) -> None:
    process, address, made = watched
    process.send_signal(signal.SIGSTOP)
    assert goes_on(made)
    process.send_signal(signal.SIGCONT)
    assert answers(address)


def test_a_stream_goes_on(watched: Any) -> None:
    with urlopen(watched[1] + "live", timeout=PATIENCE) as stream:
        lines = [stream.readline() for _ in range(9)]
    assert sum(line.startswith(b"data: {") for line in lines) >= 3


def test_it_ends_quietly(watched: Any) -> None:
    """The last test of this view."""
    process, address, _ = watched
    with urlopen(address + "live", timeout=PATIENCE) as stream:
        assert stream.readline()
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    assert process.stderr is not None and process.stderr.read() == ""
