"""What a service manager is reported, and what happens where it does not listen."""

from __future__ import annotations

import errno
import os
import re
import socket
from contextlib import suppress

import pytest

from gritd.estimator.daemon import notify
from gritd.estimator.daemon.notify import Notifier


@pytest.fixture
def manager(tmp_path):
    """A service manager's socket, and the environment it gives."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.settimeout(60.0)
        yield listener, {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "3000000"}


def test_messages_reach_the_service_manager(manager):
    listener, environment = manager
    notifier = Notifier(environment)
    assert notifier.interval == 1.0
    notifier.tell(notify.READY, notify.status("two\nlines"))
    assert listener.recv(1000) == b"READY=1\nSTATUS=two lines"
    notifier.tell(notify.reloading())
    assert re.fullmatch(rb"RELOADING=1\nMONOTONIC_USEC=\d+", listener.recv(1000))


def test_a_state_is_told_again_to_a_manager_that_was_behind(manager):
    """Its socket takes a few datagrams; strokes and status are passed over, a state is not."""
    listener, environment = manager
    notifier = Notifier(environment)
    for _ in range(1000):
        notifier.tell(notify.WATCHDOG)
    notifier.tell(notify.READY)
    taken = drained(listener)
    assert 0 < len(taken) < 1000 and set(taken) == {b"WATCHDOG=1"}
    notifier.tell(notify.WATCHDOG)
    assert drained(listener) == [b"READY=1", b"WATCHDOG=1"]


def test_a_state_is_told_again_after_a_want_of_descriptors(manager, monkeypatch):
    listener, environment = manager
    notifier = Notifier(environment)

    def none_left(*_):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with monkeypatch.context() as patched:
        patched.setattr(notify.socket, "socket", none_left)
        notifier.tell(notify.READY)
        notifier.tell(notify.WATCHDOG)
    notifier.tell(notify.WATCHDOG)
    assert drained(listener) == [b"READY=1", b"WATCHDOG=1"]


def drained(listener):
    """All datagrams that wait."""
    listener.setblocking(False)
    taken = []
    with suppress(BlockingIOError):
        while True:
            taken.append(listener.recv(1000))
    return taken


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "1"},
        {"NOTIFY_SOCKET": "/nowhere"},
    ],
)
def test_without_a_manager_nothing_is_asked_and_nothing_fails(environment):
    notifier = Notifier(environment)
    notifier.tell(notify.READY)
    assert notifier.interval == 0.0


def test_an_abstract_socket_is_understood():
    name = f"\0gritd-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(name)
        Notifier({"NOTIFY_SOCKET": "@" + name[1:]}).tell(notify.WATCHDOG)
        assert listener.recv(100) == b"WATCHDOG=1"
