"""Only one daemon writes into a log folder."""

from __future__ import annotations

import fcntl
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
        lock = open(folder / NAME, "w")  # noqa: SIM115  held for the life of the daemon
    except OSError as error:
        raise LockError(f"{folder}: cannot keep logs here: {error.strerror}") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise LockError(f"{folder}: another gritd is logging here") from None
        yield
