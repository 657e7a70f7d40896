"""Only one daemon writes into a log folder, and only one publishes its status at a socket."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

NAME = ".gritd.lock"


class LockError(Exception):
    """A folder or a socket is not ours: one line."""


class FolderLock:
    """Holds a log folder, which is made where there is none. Raises LockError."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = self._taken()

    def _taken(self) -> int:
        folder = self.folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            return _held(folder / NAME)
        except BlockingIOError:
            raise LockError(f"{folder}: another gritd is logging here") from None
        except OSError as error:
            raise LockError(f"{folder}: cannot keep logs here: {_reason(error, NAME)}") from None

    def renew(self) -> bool:
        """Hold the folder that has the name now, where somebody removed the one that was held;
        whether that was so. Raises LockError.
        """
        with suppress(OSError):
            if os.path.samestat(os.fstat(self._lock), os.lstat(self.folder / NAME)):
                return False
        gone, self._lock = self._lock, self._taken()
        os.close(gone)
        return True

    def close(self) -> None:
        os.close(self._lock)


@contextmanager
def locked(folder: Path) -> Iterator[FolderLock]:
    """Hold a log folder. Raises LockError."""
    lock = FolderLock(folder)
    try:
        yield lock
    finally:
        lock.close()


@contextmanager
def alone_at(path: Path) -> Iterator[None]:
    """Hold the place of a status socket, by a lock file beside it. Raises LockError where another
    daemon has it, or anybody listens there.
    """
    name = f".{path.name}.lock"
    try:
        lock = _held(path.with_name(name))
    except BlockingIOError:
        raise LockError(f"{path}: another gritd publishes its status here") from None
    except OSError as error:
        reason = _reason(error, name)
        raise LockError(f"{path}: cannot make the status socket: {reason}") from None

    try:
        if _answers(path):
            raise LockError(f"{path}: another program listens here")
        yield
    finally:
        os.close(lock)


def _answers(path: Path) -> bool:
    """Whether somebody listens on a Unix socket; not, where a dead daemon left it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as caller:
        try:
            code = caller.connect_ex(os.fsencode(path))
        except OSError:  # no name of a socket: said where it is made
            return False
    # EAGAIN: there is somebody, who has no room for another caller just now
    return code in (0, errno.EAGAIN)


def _held(path: Path) -> int:
    """A descriptor that holds a lock file until it is closed. A link is not followed: what it leads
    to is not ours. Raises OSError, BlockingIOError where another process holds it.
    """
    lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
    try:
        if not stat.S_ISREG(os.fstat(lock).st_mode):
            raise OSError(errno.EINVAL, f"{path.name} is no regular file")
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise

    return lock


def _reason(error: OSError, name: str) -> str:
    return f"{name} is a link" if error.errno == errno.ELOOP else str(error.strerror)
