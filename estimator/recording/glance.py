"""A first look at a recording: a long file takes no longer than a short one."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import BinaryIO

from gritd.estimator.recording.blocks import Damaged
from gritd.estimator.recording.recording import Recording
from gritd.estimator.recording.salvage import RecordingCheck, opened_to_read, take_metadata
from gritd.estimator.recording.tables import Fields, Tables
from gritd.estimator.recording.walk import Walk


def glance(path: Path | str, tables: Mapping[str, Fields], chunks: int) -> Recording:
    """Metadata, and what the first chunk, so many that lie evenly spread over the file, and the
    last ones hold; for none, the first alone. Each is checked, the file as a whole is not. Raises
    RecordingError as `read`.
    """
    path = Path(path)
    recording = Recording(path)
    wanted = Tables(tables)

    with opened_to_read(path) as file:
        _Glance(recording, {}, wanted).some(file, Walk(file, path.stat().st_size), chunks)

    recording._tables = wanted.done()
    return recording


class _Glance(RecordingCheck):
    def some(self, file: BinaryIO, walk: Walk, chunks: int) -> None:
        """Raises RecordingError where this is no MCAP file."""
        walk.begin()
        self._summary(walk.contents.summary)
        first = next(walk.blocks(), None)  # what stands before it is metadata

        if first is not None:
            after = max(first.indexes[1], first.start + first.stored)
            for block in chain((first,), walk.spread(chunks, after)):
                with suppress(Damaged):
                    self._block(file, block)
        take_metadata(self._recording, walk.contents)
