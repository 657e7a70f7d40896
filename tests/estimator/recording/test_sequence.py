"""Chunks in another place than they were written to, or twice, by the numbers of their messages."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.sequence import ChunkSequence
from gritd.tools.commands import recover
from tests.estimator.recording.samples import pieces, write_sample


def chunk_of(first: int, count: int, wrap: int = 2**32) -> dict[int, tuple[int, int, int]]:
    return {1: (first % wrap, (first + count - 1) % wrap, count)}


@given(
    start=st.sampled_from([1, 2**31 - 20, 2**32 - 20]),
    sizes=st.lists(st.integers(1, 9), min_size=1, max_size=20),
    gap=st.integers(0, 5),
)
def test_chunks_that_count_on_are_in_place_through_gaps_and_wraps(
    start: int, sizes: list[int], gap: int
) -> None:
    sequence, number = ChunkSequence(), start
    for size in sizes:
        assert sequence.follows(chunk_of(number, size))
        sequence.add(chunk_of(number, size))
        number += size + gap
    assert sequence.missing == gap * (len(sizes) - 1)
    assert sequence.counts() == {1: sum(sizes)}


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("closed", [True, False])
def test_a_recording_with_chunks_moved_or_repeated_is_said(
    tmp_path: Path, seed: int, closed: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    rng, path = random.Random(seed), tmp_path / "a.mcap"
    written = write_sample(path, 100, every=5)
    before, chunks, after = pieces(path)
    assert len(chunks) == 20
    moved, at = list(chunks), rng.randrange(1, 19)
    if seed % 2:
        moved[at], moved[rng.choice([n for n in range(20) if n != at])] = moved[0], moved[at]
        moved[0] = next(chunk for chunk in chunks if chunk not in moved)
    else:
        moved.insert(rng.randrange(at, 20), chunks[at])
    path.write_bytes(before + b"".join(moved) + (after if closed else b""))

    recording = read(path)
    assert recording.misplaced and recording.damage and not recording.saved
    assert sorted(map(repr, recording.messages())) == sorted(map(repr, written))
    assert recover.main([str(path), "-o", str(tmp_path / "b.mcap")]) == 3
    said = capsys.readouterr()
    assert "chunks in a wrong place or twice" in said.out
    assert ("in its place" if seed % 2 else "stands there twice") in said.err


def test_a_whole_recording_is_in_order(tmp_path: Path) -> None:
    write_sample(tmp_path / "a.mcap", 100, every=5)
    assert read(tmp_path / "a.mcap").misplaced == 0
