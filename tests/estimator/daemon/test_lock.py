"""Only one daemon logs into a folder, and the lock is a file of its own."""

from __future__ import annotations

import os

import pytest

from gritd.estimator.daemon.lock import LockError, locked


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
