"""The files of a run: how they are named, and which of them exist."""

from __future__ import annotations

import os
import time
from itertools import count, takewhile
from pathlib import Path


def run_path(folder: Path, name: str, started: int) -> Path:
    """RUN-YYYYmmdd-HHMMSS.mcap, in UTC, not yet taken."""
    stem = f"{name or 'run'}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime(started / 1e9))}"
    paths = (folder / f"{stem}{suffix}.mcap" for suffix in ("", *(f"-{n}" for n in range(2, 1000))))
    return next(path for path in paths if not os.path.lexists(path))


def part_path(path: Path, part: int) -> Path:
    """run.mcap, run.1.mcap, run.2.mcap, …"""
    return path if part == 0 else path.with_suffix(f".{part}{path.suffix}")


def parts(path: Path) -> list[Path]:
    """The recording and the files that continue it, in order, as far as they exist. What has a
    part's name and is no file is passed over, as the writer did.
    """
    if not path.name:  # `.` or `/`: a folder, which no file continues
        return [path]

    names = takewhile(os.path.lexists, (part_path(path, part) for part in count(1)))
    return [path, *(name for name in names if name.is_file())]
