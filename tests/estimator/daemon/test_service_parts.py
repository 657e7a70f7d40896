"""What the service is made of: notifications, pulses, the disk cap, the status socket."""

from __future__ import annotations

import errno
import json
import math
import os
import re
import socket
import stat
import time
from contextlib import suppress
from pathlib import Path

import pytest

from gritd.estimator.daemon import notify
from gritd.estimator.daemon.lock import LockError, locked
from gritd.estimator.daemon.notify import Notifier
from gritd.estimator.daemon.publish import MAX_CLIENTS, Publisher, PublishError, line_of
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import McapFile, RecordingError
from gritd.estimator.recording.retention import sweep, trim
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.writer import WriterThread
from gritd.estimator.threads import waiting
from gritd.estimator.threads.pulse import Pulse, silent
from gritd.tools.cli.command import CommandError
from gritd.tools.service import client
from tests.estimator.daemon.reports import REPORT, publishing

ROOT = Path(__file__).parents[3]


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


def test_a_pulse_is_lost_after_its_patience_and_found_again():
    beats = [0]
    pulse = Pulse("loop", lambda: beats[0], 3)
    assert [silent([pulse]) for _ in range(4)] == ["", "", "loop", "loop"]
    beats[0] += 1
    assert silent([pulse]) == ""


def test_patience_counts_looks_not_the_time_in_which_it_was_held_up(monkeypatch):
    looks = []
    monkeypatch.setattr(waiting.time, "sleep", looks.append)
    assert (
        waiting.wait_until(lambda: False, 1.0) == 0.0
        and len(looks) == 100
        and sum(looks) == pytest.approx(1.0)
    )
    looks.clear()
    assert waiting.wait_until(lambda: len(looks) == 25, 1.0) == pytest.approx(0.75)
    assert (
        waiting.wait_until(lambda: True, 1.0) == 1.0
        and waiting.wait_until(lambda: True, 0.0) == 0.0
    )


def test_what_a_killed_daemon_had_only_begun_is_swept_away(tmp_path):
    for name in (".a.mcap.new", "a.mcap", ".gritd.lock", "b.new"):
        (tmp_path / name).touch()
    sweep(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".gritd.lock", "a.mcap", "b.new"]


def test_a_recording_whose_name_a_power_cut_took_back_gets_it_again(tmp_path):
    """The folder may reach the medium later than the file: simulated by renaming a recording to its
    draft.
    """
    path = tmp_path / "a.mcap"
    thread = WriterThread(path, [], "a: 1\n", RunInfo("a"))
    thread.put([Reading(10**18 + i, "wheel_encoder", i, 10**18 + i) for i in range(10)])
    thread.stop()
    path.rename(tmp_path / ".a.mcap.new")
    assert sweep(tmp_path) == [path]
    assert read(path).arrays("/raw/wheel_encoder")["count"].tolist() == list(range(10))


def test_the_oldest_closed_recordings_go_first(tmp_path):
    paths = [tmp_path / f"{n}.mcap" for n in range(5)]
    for age, path in enumerate(paths):
        path.write_bytes(bytes(1000))
        os.utime(path, (1000 - age, 1000 - age))  # the last is the oldest
    (tmp_path / "notes.txt").write_bytes(bytes(10_000))
    assert list(trim(tmp_path, 3000, [paths[4]])) == [paths[3], paths[2]]
    assert list(trim(tmp_path, 0, [paths[4]])) == [paths[1], paths[0]]
    assert paths[4].exists() and (tmp_path / "notes.txt").exists()
    assert list(trim(tmp_path, math.inf, [])) == []


def test_the_cap_holds_beside_links_and_folders_named_like_recordings(tmp_path):
    """Whatever lies in the folder under a recording's name: what is a file goes, and only that."""
    outside = tmp_path / "outside"
    outside.write_bytes(bytes(5000))
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "0.mcap").symlink_to(tmp_path / "nothing")
    (folder / "1.mcap").symlink_to(outside)
    (folder / "2.mcap").mkdir()
    os.mkfifo(folder / "3.mcap")
    (folder / "4.mcap").write_bytes(bytes(1000))
    assert list(trim(folder, 500, [])) == [folder / "4.mcap"]
    assert outside.exists() and (folder / "1.mcap").is_symlink()


def test_a_recording_that_cannot_be_deleted_does_not_keep_the_others(tmp_path, monkeypatch):
    for n in range(3):
        (tmp_path / f"{n}.mcap").write_bytes(bytes(1000))
        os.utime(tmp_path / f"{n}.mcap", (n, n))
    unlink = Path.unlink

    def refusing(path, missing_ok=False):
        if path.name == "0.mcap":
            raise PermissionError(1, "not permitted", str(path))
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refusing)
    deleted = []
    with pytest.raises(PermissionError):
        deleted.extend(trim(tmp_path, 0, []))
    assert not (tmp_path / "1.mcap").exists() and not (tmp_path / "2.mcap").exists()


@pytest.mark.parametrize("what", ["link", "pipe"])
def test_a_lock_that_is_no_file_is_refused_and_left_alone(tmp_path, what):
    target = tmp_path / "precious"
    target.write_bytes(b"kept")
    lock = tmp_path / ".gritd.lock"
    lock.symlink_to(target) if what == "link" else os.mkfifo(lock)
    with (
        pytest.raises(LockError, match=r"cannot keep logs here: \.gritd\.lock is "),
        locked(tmp_path),
    ):
        pass
    assert target.read_bytes() == b"kept"


def test_what_is_no_draft_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / ".run.mcap.new")
    assert sweep(tmp_path) == []
    with pytest.raises(RecordingError, match=r"create: \.run\.mcap\.new is there and is no"):
        McapFile(tmp_path / "run.mcap")
    assert not (tmp_path / "run.mcap").exists()


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
    with client.connected(str(publisher.path)) as late, pytest.raises(CommandError):
        next(client.reports(late))
    assert next(client.reports(connections[0]))["pid"] == 1
    for connection in connections:
        connection.close()


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
