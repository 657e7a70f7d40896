"""Log times that are no times: another clock of the file stands for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import RAW_TOPICS

START, STEP, COUNT = 1_767_225_600 * 10**9, 4_000_000, 500
TIMES = START + STEP * np.arange(COUNT)
TOPIC = RAW_TOPICS[0]


def other(path: Path, logged: int | None, published: bool, stamped: bool) -> Path:
    """A file of another writer; logged: None for good log times, else what stands there."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(TOPIC.schema_name, "ros2msg", TOPIC.schema.encode())
        flat = writer.register_channel(TOPIC.name, "cdr", schema)
        unknown = writer.register_channel("/unknown", "", 0)
        for count, time in enumerate(TIMES.tolist()):
            log, sent = time if logged is None else logged, time if published else 0
            writer.add_message(flat, log, TOPIC.codec.encode((time if stamped else 0, count)), sent)
            writer.add_message(unknown, log, b"?", sent)
        writer.finish()
    return path


@pytest.mark.parametrize("logged", [0, 2**64 - 1, 7])
@pytest.mark.parametrize("published", [True, False])
def test_publish_times_or_stamps_stand_for_them(
    tmp_path: Path, logged: int, published: bool
) -> None:
    path = other(tmp_path / "a.mcap", logged, published, stamped=True)
    for recording in (read(path), read(path, tables={TOPIC.name: None})):
        assert len(recording.notes) == 1 and not recording.damage
        rows = recording.arrays(TOPIC.name)
        np.testing.assert_array_equal(rows["log_time"], TIMES)
        np.testing.assert_array_equal(rows["count"], np.arange(COUNT))
        assert [time for _, time, _ in recording.messages()] == TIMES.tolist()
        heads = [time for chunk in recording.chunks() for time in chunk.heads["log_time"].tolist()]
        assert heads == np.repeat(TIMES, 2).tolist()


def test_a_file_without_any_times_says_so(tmp_path: Path) -> None:
    recording = read(other(tmp_path / "a.mcap", 0, published=False, stamped=False))
    assert recording.notes and recording.counts.total() == 2 * COUNT
    assert set(recording.arrays(TOPIC.name)["log_time"]) == {0}


def test_good_log_times_stay(tmp_path: Path) -> None:
    recording = read(other(tmp_path / "a.mcap", None, published=False, stamped=False))
    assert not recording.notes
    np.testing.assert_array_equal(recording.arrays(TOPIC.name)["log_time"], TIMES)
