"""A cap on what the recordings of a folder take: the oldest closed ones go first, the open one never."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from estimator.recording.mcapfile import DRAFT


def sweep(folder: Path) -> None:
    """Delete what a killed daemon had just begun: drafts, without a message in them. Raises OSError."""
    for draft in folder.glob(f".*.mcap{DRAFT}"):
        draft.unlink()


def trim(folder: Path, cap: float, open_files: Collection[Path]) -> list[Path]:
    """Delete the oldest recordings until all of them take no more than `cap` [bytes]; what was deleted.

    Raises OSError where the folder cannot be read or a file cannot be deleted.
    """
    found = [(entry.stat().st_mtime_ns, entry.stat().st_size, entry) for entry in folder.glob("*.mcap")]
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
