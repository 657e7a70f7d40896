"""The messages of a recording as tables for other programs: one file a topic, CSV or Parquet."""

from __future__ import annotations

import csv
import importlib
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.messages.readings import NS
from gritd.estimator.recording.cdr import Rows, Topic
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.recording.topics import CHECKPOINT
from gritd.tools.recordings.nested import NestedTopic, nested

BLOCK = 5000  # rows between two signs of life
COLUMNS = "columns.csv"  # what every column is
TIME = "time"  # the first column [s]
TIME_MEANING = "seconds since the first message of the run, by receive time"

Advance = Callable[[int], None]
AnyTopic = Topic | NestedTopic


def exportable(recordings: Sequence[Recording]) -> list[str]:
    """The names of the topics that become a table: all but checkpoints, which are the filter's
    own.
    """
    sources = (source for recording in recordings for source in recording.sources.values())
    return sorted({source.topic.name for source in sources} - {CHECKPOINT})


def exported(recordings: Sequence[Recording], name: str) -> AnyTopic:
    """A topic with the fields that become columns. Raises Undecodable."""
    known = {name: topic for recording in recordings for name, topic in recording.topics.items()}
    return known.get(name) or nested(recordings, name)


def file_of(topic: str, suffix: str) -> str:
    """The name of a topic's file: /raw/motor_shunt becomes raw_motor_shunt.csv."""
    return f"{topic.strip('/').replace('/', '_')}.{suffix}"


def start_of(recordings: Sequence[Recording]) -> int:
    """Receive time of the first message [ns]; 0 for none."""
    times = [
        int(chunk.heads["log_time"].min())
        for recording in recordings
        for chunk in recording.chunks()
        if len(chunk.starts)
    ]
    return min(times, default=0)


def write_csv(
    path: Path, topic: AnyTopic, recordings: Sequence[Recording], start: int, advance: Advance
) -> None:
    """One topic. Stamps are in ns since the epoch. A missing message is a missing row; NaN is an
    empty cell. Raises OSError.
    """
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([TIME, *topic.names])

        for rows in _blocks(topic, recordings, start):
            writer.writerows([["" if v is None or v != v else v for v in row] for row in rows])
            advance(len(rows))


def write_parquet(
    path: Path, topic: AnyTopic, recordings: Sequence[Recording], start: int, advance: Advance
) -> None:
    """One topic, as `write_csv`. Raises OSError; needs pyarrow."""
    pyarrow = importlib.import_module("pyarrow")
    parquet = importlib.import_module("pyarrow.parquet")
    rows = [row for block in _blocks(topic, recordings, start) for row in block]
    names = [TIME, *topic.names]

    columns = {
        name: _column(pyarrow, [row[place] for row in rows]) for place, name in enumerate(names)
    }
    parquet.write_table(pyarrow.table(columns), path)
    advance(len(rows))


def _column(pyarrow: Any, values: list[Any]) -> Any:
    """As pyarrow takes it; counts beyond 63 bits are unsigned."""
    try:
        return pyarrow.array(values)
    except OverflowError:
        return pyarrow.array(values, type=pyarrow.uint64())


def write_columns(path: Path, topics: Sequence[AnyTopic], suffix: str) -> None:
    """What every column of every file means. Raises OSError."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["file", "column", "meaning"])
        for topic in topics:
            name = file_of(topic.name, suffix)
            writer.writerow([name, TIME, f"{TIME_MEANING} [s]"])
            writer.writerows([name, field, doc] for field, _, doc in topic.fields)


def _blocks(
    topic: AnyTopic, recordings: Sequence[Recording], start: int
) -> Iterator[list[tuple[Any, ...]]]:
    """The rows of a topic, with the time in front, some at a time."""
    if isinstance(topic, NestedTopic):
        rows = topic.rows(recordings, start)
        while block := list(islice(rows, BLOCK)):
            yield block
        return

    for recording in recordings:
        if topic.name not in recording.topics:
            continue
        if not topic.codec.flat:
            yield [
                ((time - start) / NS, *values)
                for name, time, values in recording.messages()
                if name == topic.name
            ]
            continue

        table = recording.arrays(topic.name)
        for first in range(0, len(table), BLOCK):
            yield _timed(table[first : first + BLOCK], topic, start)


def _timed(table: Rows, topic: Topic, start: int) -> list[tuple[Any, ...]]:
    """Rows of a structured array (n,) as tuples."""
    times = ((table["log_time"] - start) / NS).tolist()
    columns = [np.asarray(table[name]).tolist() for name in topic.names]
    return list(zip(times, *columns, strict=True))
