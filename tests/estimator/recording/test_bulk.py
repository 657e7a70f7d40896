"""Many readings at once: the file is the same, byte for byte."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter

Streams = list[tuple[str, NDArray[np.int64], NDArray[np.generic]]]


def streams(seed: int, sizes: tuple[int, int, int], spread: int) -> Streams:
    """Counts, volts and a wrench at stamps that rise, many of them equal where `spread` is 0."""
    rng = np.random.default_rng(seed)
    times = [10**18 + np.cumsum(rng.integers(0, 1 + spread, n)) for n in sizes]
    return [
        ("wheel_encoder", times[0], rng.integers(-(2**62), 2**62, sizes[0])),
        ("sinkage_pot", times[1], rng.normal(size=sizes[1])),
        ("wrench", times[2], rng.normal(size=(sizes[2], 6))),
    ]


def one_by_one(writer: RunWriter, given: Streams) -> None:
    rows = [
        (stamp, number, channel, value)
        for number, (channel, stamps, values) in enumerate(given)
        for stamp, value in zip(stamps.tolist(), values.tolist(), strict=True)
    ]
    for stamp, _, channel, value in sorted(rows, key=lambda row: row[:2]):
        plain = tuple(value) if isinstance(value, list) else value
        writer.reading(Reading(stamp, channel, plain, stamp))


@given(
    seed=st.integers(0, 99),
    sizes=st.tuples(*(st.integers(0, 40) for _ in range(3))),
    spread=st.sampled_from([0, 1, 10**7]),
    chunk=st.sampled_from([1, 100, 333, 10_000]),
    cut=st.integers(0, 40),
)
def test_the_bytes_are_those_of_one_by_one(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    sizes: tuple[int, int, int],
    spread: int,
    chunk: int,
    cut: int,
) -> None:
    """Whatever the sizes of chunks, and whatever was written before."""
    folder, made = tmp_path_factory.mktemp("bulk"), streams(seed, sizes, spread)
    edge = 10**18 + cut * spread
    halves = [
        [(name, t[t < edge], v[t < edge]) for name, t, v in made],
        [(name, t[t >= edge], v[t >= edge]) for name, t, v in made],
    ]
    for path, bulk in ((folder / "bulk.mcap", True), (folder / "each.mcap", False)):
        writer = RunWriter(path, (), "a: 1", RunInfo("run"), chunk_size=chunk)
        for half in halves:
            writer.readings(half) if bulk else one_by_one(writer, half)
        writer.close()
    assert (folder / "bulk.mcap").read_bytes() == (folder / "each.mcap").read_bytes()


@pytest.mark.parametrize(
    ("stamps", "values"),
    [
        (np.array([-1]), np.array([1])),
        (np.array([2**62]), np.array([1])),
        (np.array([1]), np.array([0.5])),
        (np.array([1]), np.array([[1, 2]])),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, stamps: NDArray[np.int64], values: NDArray[np.generic]
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", (), "a: 1", RunInfo("run"))
    with pytest.raises(ValueError, match="wheel_encoder"):
        writer.readings([("wheel_encoder", stamps, values)])
    writer.close()
