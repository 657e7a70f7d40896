"""A port belongs to one process: a lock on its device file, as pyserial has it; who holds it."""

from __future__ import annotations

import errno
import fcntl
import os
from contextlib import suppress
from pathlib import Path

LOCKS = Path("/proc/locks")
SHOWN = 60  # characters of a command line


def held(path: str) -> int:
    """A descriptor that locks a device file until it is closed. Raises OSError, with EWOULDBLOCK
    and who has it where another process holds it.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise OSError(errno.EWOULDBLOCK, in_use(path)) from None
    return descriptor


def in_use(path: str) -> str:
    """That a device file is locked, and by whom."""
    return f"in use by {holder_of(path) or 'another process'}"


def holder_of(path: str) -> str:
    """The process that holds a device file's lock, 'process 12 (gritd run …)'; '' where none does,
    or none that can be seen.
    """
    with suppress(OSError):
        status = os.stat(path)
        device = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
        for line in LOCKS.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split()  # 1: FLOCK ADVISORY WRITE 4711 00:18:12 0 EOF
            if words[1:2] == ["FLOCK"] and words[5:6] == [device] and words[4] != str(os.getpid()):
                return f"process {words[4]}{_command(words[4])}"
    return ""


def _command(process: str) -> str:
    with suppress(OSError):
        words = Path("/proc", process, "cmdline").read_bytes().split(b"\0")
        return f" ({b' '.join(words).decode(errors='replace').strip()[:SHOWN]})"
    return ""
