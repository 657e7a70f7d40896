"""A computer, or a limit, that has too little memory for a command: said in one line."""

from __future__ import annotations

import ctypes
import errno
import mmap
import resource
from collections.abc import Iterator
from contextlib import suppress

# How C libraries say that there is no memory for them, or for a part of them.
WORDS = ("failed to map segment", "cannot allocate", "can't start new thread", "not enough mem")
# [bytes] of address space that numpy takes with its linear algebra, and scipy beyond it
ROOM = 150 << 20
# [bytes] of address space below which children find no room beside what they inherit
AMPLE = 2 << 30


def reserve(scipy: bool) -> None:
    """Where memory is limited, load the linear algebra and let it take its buffers: where it finds
    none later, it ends the process without a word of ours, or tries for ever. Raises MemoryError.

    scipy: whether its linear algebra will be wanted too, which is a second one.
    """
    if not _most():
        return
    _room()
    import numpy as np

    square = np.ones((128, 128))
    np.dot(square, square)
    if scipy:
        _room()
        from scipy.linalg import blas

        blas.dgemm(1.0, square, square)


def is_scarce() -> bool:
    """Whether address space is limited so far that work is better done in one process: a child
    that finds none ends with words of its own.
    """
    return 0 < _most() < AMPLE


def _room() -> None:
    try:
        mmap.mmap(-1, ROOM).close()
    except OSError as error:
        raise MemoryError(str(error)) from None


def give_back() -> None:
    """Hand back to the system what was freed: glibc keeps gaps between what is still held."""
    with suppress(AttributeError, OSError):  # another C library
        ctypes.CDLL(None).malloc_trim(0)


def line(error: BaseException) -> str:
    """What to say of an error behind which a want of memory stands; '' for any other."""
    causes = list(_chain(error))
    if any(type(cause).__name__ == "BrokenProcessPool" for cause in causes):
        return "a worker process was ended before it was done, as happens where memory is short"
    if not any(map(_is_want, causes)):
        return ""
    most = _most()
    bound = f": its address space is limited to {most / 1e6:.0f} MB (ulimit -v)" if most else ""
    return f"there is not enough memory for it{bound}"


def _is_want(error: BaseException) -> bool:
    message = str(error).lower()
    short = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
    return short or any(words in message for words in WORDS)


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _most() -> int:
    """[bytes] of address space; 0 where it is not limited."""
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    return 0 if most == resource.RLIM_INFINITY else most
