"""Child processes that do not outlive us, however we end."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable

PR_SET_PDEATHSIG = 1  # prctl(2)
_LIBC = ctypes.CDLL(None, use_errno=True)


def ends_with_us() -> Callable[[], None]:
    """What a child does first, so that the kernel ends it when this process ends: by SIGTERM, even
    where this process is killed.
    """
    parent = os.getpid()

    def bind() -> None:
        bind_to(parent)

    return bind


def bind_to(parent: int) -> None:
    """In the child: end with the process `parent`, which started it."""
    _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if os.getppid() != parent:  # it has ended already
        os._exit(1)
