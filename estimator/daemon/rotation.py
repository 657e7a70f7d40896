"""When the recording goes on in a new part: the present one is large, old, failed, or gone."""

from __future__ import annotations

import time
from pathlib import Path

from gritd.estimator.config.settings import Logging
from gritd.estimator.recording.writer import WriterStatus

MIN_PART = 1.0  # [s] a part is at least this long
MAX_CHUNKS = 400_000  # and of no more flushes than this: a reader takes 500,000


class Rotation:
    """Follows the part that is written. A part begins where `due` says so, or where `begin`
    does.
    """

    def __init__(self) -> None:
        self.deleted: list[Path] = []  # parts that somebody deleted while they were written
        self._began = time.monotonic()
        self._ended: Path | None = None  # the last part that `due` spoke of

    def begin(self) -> None:
        """A part begins for another reason."""
        self._began = time.monotonic()

    def due(self, logging: Logging, status: WriterStatus) -> bool:
        """Whether a part should begin now; once for each part."""
        age, part = time.monotonic() - self._began, status.files[-1]
        if status.suspect and part != self._ended:
            return self._end(part)
        if age < MIN_PART or status.state != "writing" or part == self._ended:
            return False

        size = _size(part)
        if size is None:
            self.deleted.append(part)

        longest = min(logging.part_time, MAX_CHUNKS * logging.flush_interval)
        largest = min(logging.part_size, logging.disk_cap / 2.0)
        if size is not None and size <= largest and age <= longest:
            return False

        return self._end(part)

    def _end(self, part: Path) -> bool:
        self._began, self._ended = time.monotonic(), part
        return True


def _size(path: Path) -> int | None:
    """[bytes]; None where nothing is."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return None
    except OSError:
        return 0
