"""The queue's account: received = processed + dropped + queued, exactly, at every moment."""

from __future__ import annotations

import threading

from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.queue import QueueCounts, ReadingQueue
from gritd.estimator.messages.readings import Reading
from tests.drivers.rig import FUZZ


def readings(count, first=0):
    return [Reading(n, "sinkage_pot", 1.0, n) for n in range(first, first + count)]


def balanced(counts: QueueCounts) -> bool:
    return counts.received == counts.processed + counts.dropped + counts.queued


@FUZZ
@given(st.integers(1, 20), st.lists(st.none() | st.integers(0, 50), max_size=30))
def test_the_newest_are_kept_and_the_account_is_exact(capacity, actions):
    queue = ReadingQueue(capacity)
    kept: list[Reading] = []
    sent = 0
    for action in actions:
        if action is None:
            assert queue.drain() == kept
            kept = []
        else:
            queue.put(readings(action, sent))
            kept = [*kept, *readings(action, sent)][-capacity:]
            sent += action
        assert balanced(queue.counts())
        assert queue.counts().received == sent and queue.counts().queued == len(kept)


def test_the_account_is_exact_under_threads_and_overflow():
    queue = ReadingQueue(100)
    seen: list[bool] = []
    running = threading.Event()
    running.set()

    def produce():
        for n in range(2000):
            queue.put(readings(n % 13))

    def watch():
        while running.is_set():
            seen.append(balanced(queue.counts()))

    producers = [threading.Thread(target=produce) for _ in range(3)]
    watcher = threading.Thread(target=watch)
    watcher.start()
    for thread in producers:
        thread.start()
    drained = 0
    while any(thread.is_alive() for thread in producers):
        drained += len(queue.drain())
    drained += len(queue.drain())
    running.clear()
    watcher.join()
    counts = queue.counts()
    assert all(seen) and balanced(counts) and counts.queued == 0
    assert counts.processed == drained
    assert counts.received == 3 * sum(n % 13 for n in range(2000))


def test_a_stalled_consumer_loses_the_oldest():
    queue = ReadingQueue(10)
    for reading in readings(1000):
        queue.put([reading])
    assert queue.counts() == (1000, 0, 990, 10)
    assert [reading.stamp for reading in queue.drain()] == list(range(990, 1000))
