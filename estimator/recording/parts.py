"""The files of a run: how they are named, and which of them exist."""

from __future__ import annotations

import time
from pathlib import Path


def run_path(folder: Path, name: str, started: int) -> Path:
    """RUN-YYYYmmdd-HHMMSS.mcap, in UTC, not yet taken."""
    stem = f"{name or 'run'}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime(started / 1e9))}"
    paths = (folder / f"{stem}{suffix}.mcap" for suffix in ("", *(f"-{n}" for n in range(2, 1000))))
    return next(path for path in paths if not path.exists())


def part_path(path: Path, part: int) -> Path:
    """run.mcap, run.1.mcap, run.2.mcap, …"""
    return path if part == 0 else path.with_suffix(f".{part}{path.suffix}")


def parts(path: Path) -> list[Path]:
    """The recording and the files that continue it, in order, as far as they exist."""
    found = [path]
    while (following := part_path(path, len(found))).exists():
        found.append(following)
    return found
