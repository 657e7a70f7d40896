"""A first look at a recording: its metadata, its first and its last messages, whatever happened to
the file.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gritd.estimator.recording.glance import glance
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import read
from tests.estimator.recording.samples import write_sample

TOPIC = "/raw/wheel_encoder"
TABLES = {TOPIC: ("stamp", "count")}


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("glance") / "run.mcap"
    write_sample(path, count=1500)
    return path


@pytest.mark.parametrize("chunks", [1, 7, 1000])
def test_it_has_metadata_and_both_ends_and_nothing_twice(sample: Path, chunks: int) -> None:
    whole = read(sample).arrays(TOPIC)
    some = glance(sample, TABLES, chunks)
    rows = some.tables(TABLES)[TOPIC]
    assert some.run.name == "sample" and some.config_yaml
    assert rows["stamp"][0] == whole["stamp"][0] and rows["stamp"][-1] == whole["stamp"][-1]
    assert (rows["stamp"][1:] > rows["stamp"][:-1]).all()
    assert set(rows["stamp"]) <= set(whole["stamp"])


def test_a_short_file_is_seen_whole(tmp_path: Path) -> None:
    write_sample(tmp_path / "run.mcap")
    rows = glance(tmp_path / "run.mcap", TABLES, 3).tables(TABLES)[TOPIC]
    assert rows.tobytes() != b"" and len(rows) == len(read(tmp_path / "run.mcap").arrays(TOPIC))


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0.0, 1.0), st.integers(0, 255))
def test_a_cut_or_altered_file_gives_what_is_good_of_it(
    sample: Path, tmp_path: Path, share: float, byte: int
) -> None:
    data = bytearray(sample.read_bytes())
    place = int(share * (len(data) - 1))
    known = set(read(sample).arrays(TOPIC)["stamp"])
    for changed in (data[:place], data[:place] + bytes([byte]) + data[place + 1 :]):
        path = tmp_path / "x.mcap"
        path.write_bytes(changed)
        try:
            found = glance(path, TABLES, 5)
        except RecordingError:
            continue
        if found.counts[TOPIC]:
            assert set(found.tables(TABLES)[TOPIC]["stamp"]) <= known
