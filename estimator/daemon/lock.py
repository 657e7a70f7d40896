"""Only one daemon writes into a log folder."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NAME = ".gritd.lock"


class LockError(Exception):
    """Logs cannot be kept in a folder: one line."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder, which is made where there is none. Raises LockError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = _opened(folder / NAME)
    except OSError as error:
        raise LockError(f"{folder}: cannot keep logs here: {_reason(error)}") from None

    try:
        _take(lock, folder)
        yield
    finally:
        os.close(lock)


def _take(lock: int, folder: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise LockError(f"{folder}: another gritd is logging here") from None


def _opened(path: Path) -> int:
    """A descriptor of the lock file, held for the life of the daemon. A link is not followed: what
    it leads to is not ours. Raises OSError.
    """
    lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
    if stat.S_ISREG(os.fstat(lock).st_mode):
        return lock
    os.close(lock)
    raise OSError(errno.EINVAL, f"{NAME} is no regular file")


def _reason(error: OSError) -> str:
    return f"{NAME} is a link" if error.errno == errno.ELOOP else str(error.strerror)
