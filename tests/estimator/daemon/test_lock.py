"""Only one daemon logs into a folder, and the lock is a file of its own."""

from __future__ import annotations

import os
import shutil
import socket

import pytest

from gritd.estimator.daemon.lock import LockError, alone_at, locked


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


def test_a_socket_belongs_to_one_daemon(tmp_path):
    path = tmp_path / "gritd.sock"
    taken = pytest.raises(LockError, match="another gritd publishes its status here")
    with alone_at(path), taken, alone_at(path):
        pass
    with alone_at(path):
        pass


def test_a_socket_that_somebody_listens_on_is_left_to_him(tmp_path):
    path = tmp_path / "other.sock"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        with alone_at(path):
            pass  # nobody listens yet: left by the dead
        other.listen(0)
        for _ in range(3):  # the second finds no room
            with pytest.raises(LockError, match="another program listens here"), alone_at(path):
                pass


def test_a_place_where_no_socket_can_be_is_one_line(tmp_path):
    nowhere = tmp_path / "nowhere" / "gritd.sock"
    no_place = pytest.raises(LockError, match="cannot make the status socket: No such file")
    with no_place, alone_at(nowhere):
        pass


def test_a_folder_that_was_removed_is_made_and_held_again(tmp_path):
    folder = tmp_path / "logs"
    with locked(folder) as lock:
        assert not lock.renew()
        shutil.rmtree(folder)
        assert lock.renew() and not lock.renew()
        with pytest.raises(LockError, match="another gritd is logging here"), locked(folder):
            pass
    with locked(folder):
        pass
