"""A cap on what the recordings of a folder take: the oldest closed ones go first, the open one
never.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from gritd.estimator.recording.blocks import Walk
from gritd.estimator.recording.mcapfile import DRAFT, RecordingError


def sweep(folder: Path) -> list[Path]:
    """Delete what a killed daemon had just begun: drafts, without a message in them.

    A draft with messages had its name, and a power cut took it back: it gets it again. Those are
        returned.
    """
    found = []
    for draft in sorted(folder.glob(f".*.mcap{DRAFT}")):
        path = draft.with_name(draft.name[1:].removesuffix(DRAFT))
        with suppress(OSError):  # one that cannot be read is left for whoever can
            if not _messages(draft):
                draft.unlink()
            elif not path.exists():
                found.append(draft.rename(path))
    return found


def _messages(draft: Path) -> bool:
    with draft.open("rb") as file:
        try:
            return bool(Walk(file, draft.stat().st_size).run().blocks)
        except RecordingError:
            return False


def trim(folder: Path, cap: float, open_files: Collection[Path]) -> list[Path]:
    """Delete the oldest recordings until all of them take no more than `cap` [bytes]; what was
    deleted.

    Raises OSError where the folder cannot be read or a file cannot be deleted.
    """
    found = [
        (entry.stat().st_mtime_ns, entry.stat().st_size, entry) for entry in folder.glob("*.mcap")
    ]
    kept = {path.absolute() for path in open_files}
    excess = sum(size for _, size, _ in found) - cap
    deleted = []
    for _, size, path in sorted(found):
        if excess <= 0:
            break
        if path.absolute() not in kept:
            path.unlink()
            deleted.append(path)
            excess -= size
    return deleted
