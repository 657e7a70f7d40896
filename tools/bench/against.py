"""The same work by gritd and by what else a user could take, by turns in one run.

Every name that begins with `over_` is how many times the processor time of gritd the other takes:
larger is better for gritd.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from time import process_time

from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import TICK_TOPIC
from gritd.tools.bench import peers

Figures = dict[str, float]


def by_turns(runs: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, list[float]]:
    """Processor time of every repetition [s], by name: each runs once, then each again, so that
    what disturbs one disturbs all.
    """
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            start = process_time()
            run()
            spent[name].append(process_time() - start)
    return spent


def spread(name: str, times: list[float], each: float = 1.0) -> Figures:
    """Median, best and worst of times, over `each`."""
    return {
        name: statistics.median(times) / each,
        f"{name}_best": min(times) / each,
        f"{name}_worst": max(times) / each,
    }


def compared(spent: Mapping[str, list[float]], ours: str, each: float) -> Figures:
    """Spreads of all, and ratios of medians to ours."""
    mine = statistics.median(spent[ours])
    figures: Figures = {}
    for name, times in spent.items():
        figures |= spread(name, times, each)
        if name != ours:
            figures[f"over_{name}"] = statistics.median(times) / mine
    return figures


def reading(path: Path, repeats: int) -> Figures:
    """A message of a recording with ticks, into numbers, by every reader that is installed, and
    what unpacking alone takes of it [s]. Raises AssertionError where one reads another number of
    messages.
    """
    readers = peers.readers()
    messages = peers.ours(path)
    counts = {name: reader(path) for name, reader in readers.items()}
    assert set(counts.values()) == {messages}, counts

    def run(reader: peers.Reader) -> Callable[[], object]:
        return lambda: reader(path)

    runs = {name: run(reader) for name, reader in readers.items()}
    spent = by_turns({**runs, "unpacking": peers.unpacking(path)}, repeats)
    return compared(spent, "gritd", messages) | {"messages": messages}


def writing(path: Path, repeats: int) -> Figures:
    """A message of a recording with ticks, to a file; for the others it is encoded already [s]."""
    known = {topic.name: topic for topic in peers.TOPICS}
    recording = read(path)
    messages = [message for message in recording.messages() if message[0] in known]
    encoded = [(name, time, known[name].codec.encode(values)) for name, time, values in messages]
    numbers = count()

    def fresh(suffix: str) -> Path:
        return path.with_name(f"written-{next(numbers)}{suffix}")

    def ours() -> None:
        writer = RunWriter(fresh(".mcap"), (TICK_TOPIC,), "", RunInfo())
        for message in messages:
            writer.message(*message)
        writer.close()

    runs: dict[str, Callable[[], object]] = {
        "gritd": ours,
        "mcap": lambda: peers.write_by_mcap(fresh(".mcap"), encoded),
    }
    if "rosbags" in peers.readers():
        runs["rosbags"] = lambda: peers.write_by_rosbags(fresh(""), encoded)
    return compared(by_turns(runs, repeats), "gritd", len(messages))
