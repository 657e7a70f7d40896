"""A cap on what the recordings of a folder take: the oldest closed ones go first, the open one
never.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.recording.mcapfile import DRAFT, RecordingError
from gritd.estimator.recording.walk import Walk


def sweep(folder: Path) -> list[Path]:
    """Delete what a killed daemon had just begun: drafts, without a message in them.

    A draft with messages had its name, and a power cut took it back: it gets it again. Those are
        returned.
    """
    renamed = []
    for draft in sorted(folder.glob(f".*.mcap{DRAFT}")):
        path = draft.with_name(draft.name[1:].removesuffix(DRAFT))
        with suppress(OSError):  # one that cannot be read is left for whoever can
            if not _is_file(draft):
                continue
            if not _messages(draft):
                draft.unlink()
            elif not os.path.lexists(path):
                renamed.append(draft.rename(path))

    return renamed


def _messages(draft: Path) -> bool:
    with draft.open("rb") as file:
        try:
            walk = Walk(file, draft.stat().st_size)
            walk.begin()
            return next(walk.blocks(), None) is not None
        except RecordingError:
            return False


def trim(folder: Path, cap: float, open_files: Collection[Path]) -> Iterator[Path]:
    """Delete the oldest recordings until all of them take no more than `cap` [bytes]; each that was
    deleted. Only files count: a link or a folder of a recording's name is passed over.

    Raises OSError where the folder cannot be read; where a file cannot be deleted, after all the
    others were tried.
    """
    stored = sorted(_sizes(folder))
    kept = {path.absolute() for path in open_files}
    excess = integer_sum(size for _, size, _ in stored) - cap
    failure = None

    for _, size, path in stored:
        if excess <= 0:
            break
        if path.absolute() in kept:
            continue
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            failure = error
            continue
        excess -= size
        yield path

    if failure is not None:
        raise failure


def _sizes(folder: Path) -> Iterator[tuple[int, int, Path]]:
    """When each recording was written last [ns], its size [bytes] and its path."""
    for path in folder.glob("*.mcap"):
        with suppress(FileNotFoundError):  # deleted meanwhile
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                yield status.st_mtime_ns, status.st_size, path


def _is_file(path: Path) -> bool:
    return stat.S_ISREG(path.lstat().st_mode)
