"""The process under pressure: clock steps, stalls, a full queue."""

from __future__ import annotations

import random
import time
from threading import Event, Thread

import numpy as np
import pytest

import gritd.estimator.daemon.clock
from gritd.drivers.queue import ReadingQueue
from gritd.estimator.daemon.clock import Clock
from gritd.estimator.daemon.loop import Loop
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.topics import TICK_TOPIC
from tests.scenarios.conftest import slow
from tests.scenarios.recorded import log_lines, rows, unreported, verified
from tests.scenarios.rig import TESTBED, WIRES, driven, service

CLOCK = "loop over a simulated monotonic clock"


# ---- wall clock ----------------------------------------------------------------------------------


class SimulatedTime:
    """Stands for the module `time`: monotonic time moves in a sleep, the wall can be set."""

    def __init__(self, steps):
        self.monotonic, self.wall = 10**12, 1_700_000_000 * 10**9
        self.steps = dict(steps)  # monotonic seconds from the start -> step of the wall [s]
        self.began = self.monotonic

    def monotonic_ns(self):
        return self.monotonic

    def time_ns(self):
        return self.wall

    def sleep(self, seconds):
        self.monotonic += round(seconds * 1e9)
        self.wall += round(seconds * 1e9)
        for at in [at for at in self.steps if self.monotonic - self.began >= at * 1e9]:
            self.wall += round(self.steps.pop(at) * 1e9)


class Kept:
    """A sink that keeps the ticks as they would be logged."""

    def __init__(self, stop, ticks):
        self.ticks, self.offsets, self._stop, self._wanted = [], [], stop, ticks

    def put(self, readings, tick, loop):
        self.ticks.append(TICK_TOPIC.codec.encode(tick))
        self.offsets.append(loop.wall_offset)
        if len(self.ticks) >= self._wanted:
            self._stop.set()

    def counts(self):
        return 0, 0

    def checkpoint(self, *what):
        raise AssertionError("nobody asked")


class Due:
    """A source that gives readings when the clock says that they have arrived."""

    def __init__(self, readings, clock):
        start = clock.now()
        self._clock, self._next = clock, 0
        self._readings = [
            r._replace(stamp=r.stamp + start, received=r.received + start) for r in readings
        ]

    def drain(self):
        first, now = self._next, self._clock.now()
        while self._next < len(self._readings) and self._readings[self._next].received <= now:
            self._next += 1
        return self._readings[first : self._next]

    def dropped(self):
        return 0


def ticks_under(steps, readings, monkeypatch):
    monkeypatch.setattr(gritd.estimator.daemon.clock, "time", SimulatedTime(steps))
    clock, stop = Clock(), Event()
    sink = Kept(stop, 1000)
    Loop(Pipeline(TESTBED.settings, "plain"), Due(readings, clock), sink, clock).run(stop)
    return sink


def test_wall_clock_step(seed, monkeypatch, figure):
    rng = random.Random(seed)
    readings = driven(6.0, seed)
    straight = ticks_under({}, readings, monkeypatch)
    sizes = [sign * 10.0**power for power in (2, 4, 6, 8) for sign in (-1, 1)]
    steps = {rng.uniform(0.5, 3.5): size for size in sizes}
    stepped = ticks_under(steps, readings, monkeypatch)
    different = sum(a != b for a, b in zip(straight.ticks, stepped.ticks, strict=True))
    assert max(map(abs, stepped.offsets)) > 0.9e2
    figure(
        "wall-clock step",
        CLOCK,
        "ticks that differ by a bit, of 1000 with steps of ±1e2 … ±1e8 s",
        different,
        "",
        0,
    )


STEPPING = """
import time, gritd.estimator.daemon.clock
class Stepping:
    monotonic_ns, began = time.monotonic_ns, None
    @classmethod
    def sleep(cls, seconds):
        cls.began = cls.began or time.monotonic()
        time.sleep(seconds)
    @classmethod
    def time_ns(cls):
        return time.time_ns() + (10**17 if cls.began and time.monotonic() > cls.began + 2.0 else 0)
gritd.estimator.daemon.clock.time = Stepping
"""


def test_a_step_in_the_running_daemon_is_annotated(tmp_path, seed, figure):
    with service(tmp_path, driven(40.0, seed, skip=1.0), prelude=STEPPING) as (_, daemon):
        daemon.wait_status(lambda report: report["loop"]["wall_offset"] > 1.0)
        time.sleep(0.5)
        daemon.stop()
    stamps = rows(daemon.path(), "/tick")["stamp"]
    assert unreported(daemon.path()) == 0
    assert any("wall clock stepped by +100000000" in line for line in log_lines(daemon.path()))
    row, level = "wall-clock step", f"{WIRES}, the step simulated in its time.time_ns"
    jump = np.max(np.diff(stamps)) * 1e-9
    figure(row, level, "largest gap between ticks", jump, "s", 1.0, real=True)
    assert verified(daemon.path())


YEARS = {  # [s]; the system tells no time in nanoseconds after April 2262
    1901: -2_170_000_000,
    1970: 50,
    2040: 2_210_000_000,
    2200: 7_260_000_000,
    2603: 20_000_000_000,
}
SET = """
import time
real, origin = time.time_ns, {origin} * 10**9 - time.time_ns()
def shifted():
    if real() + origin >= 1 << 63:
        raise OverflowError("timestamp too large to convert to C _PyTime_t")  # as Python has it
    return real() + origin
time.time_ns = shifted
time.time = lambda: (real() + origin) * 1e-9
"""


@pytest.mark.parametrize("year", [1970, slow(1901), slow(2040), slow(2200), 2603])
def test_a_wall_clock_in_another_year(tmp_path, year, seed, figure):
    """Everything is recorded, and a line and the status say that the stamps are not dates."""
    prelude = SET.format(origin=YEARS[year])
    with service(tmp_path, driven(8.0, seed, skip=1.0), prelude=prelude) as (wires, daemon):
        wires.finish()
        report = daemon.status()
        daemon.stop()
    words = f"the wall clock says {min(year, 2262)}-"
    assert report["wall_clock"].startswith(words)
    assert len(daemon.lines(words)) == 1 and not daemon.lines("wall clock stepped")
    assert sum(words in line for line in log_lines(daemon.path())) == 1
    accepted, _, dropped, _ = daemon.account()
    row, level = "wall clock in 1901, 1970, 2040, 2200, 2603", f"{WIRES}, its time.time_ns shifted"
    figure(row, level, "messages recorded", accepted - dropped)
    figure(row, level, "messages lost", dropped, "", 0)
    assert accepted > 5000 and np.all(np.diff(rows(daemon.path(), "/tick")["stamp"]) > 0)
    assert verified(daemon.path())


UNFIT = """
import atexit, sys
from gritd.estimator.daemon.log_sink import LogSink
from gritd.estimator.recording.topics import messages_of
atexit.register(lambda: print("spoilt", made, file=sys.stderr, flush=True))
put, number, made = LogSink.put, 0, 0
def spoilt(self, readings, tick, loop):
    global number, made
    number += 1
    if number % 250 == 0:
        tick = (2**63, *tick[1:])
        made += len(list(messages_of(tick)))
    put(self, readings, tick, loop)
LogSink.put = spoilt
"""


def test_a_message_that_cannot_be_written(tmp_path, seed, figure):
    """One tick in 250 does not fit its fields: what is made of it, a tick and now and then an
    estimate, alone is lost, counted and said.
    """
    with service(tmp_path, driven(8.0, seed, skip=1.0), prelude=UNFIT) as (wires, daemon):
        wires.finish()
        daemon.heard("messages could not be written")
        daemon.stop()
    row, level = "message that cannot be written", f"{WIRES}, a tick in 250 spoilt in its process"
    _, _, dropped, _ = daemon.account()
    (line,) = [line for _, line in daemon.lines("spoilt ")]
    spoilt = int(line.split()[1])
    figure(row, level, "messages spoilt", spoilt)
    figure(row, level, "messages lost for each", dropped / spoilt, "", 1)


# ---- queue ---------------------------------------------------------------------------------------


class Stalled:
    """A queue's consumer that stalls."""

    def __init__(self, queue, rng):
        self.queue, self.rng, self.taken = queue, rng, 0

    def run(self, stop):
        while not stop.is_set():
            self.taken += len(self.queue.drain())
            time.sleep(self.rng.uniform(0.0, 0.1))


def test_queue_overflow(seed, figure):
    """Three producers, a consumer that stalls, a small queue: the account is always exact."""
    rng = random.Random(seed)
    queue, stop = ReadingQueue(capacity=64), Event()
    consumer = Stalled(queue, rng)
    readings = driven(6.0, seed)[:9000]
    producers = [Thread(target=feed, args=(queue, readings[n::3])) for n in range(3)]
    consuming = Thread(target=consumer.run, args=(stop,))
    for thread in (*producers, consuming):
        thread.start()
    wrong = 0
    while any(thread.is_alive() for thread in producers):
        c = queue.counts()
        wrong += c.received != c.processed + c.dropped + c.queued
    stop.set()
    consuming.join()
    counts = queue.counts()
    assert counts.dropped > 0 and counts.processed == consumer.taken
    assert counts.received == len(readings) == counts.processed + counts.dropped + counts.queued
    figure(
        "queue overflow",
        "reading queue and threads, the stall simulated",
        "moments of inexact account",
        wrong,
        "",
        0,
    )


def feed(queue, readings):
    for start in range(0, len(readings), 10):
        queue.put(readings[start : start + 10])
        time.sleep(0.001)


STALLING = """
import os, time
from gritd.estimator.online.pipeline import Pipeline
step, calls = Pipeline.step, [0]
def stalling(self, *arguments):
    calls[0] += 1
    while calls[0] == 1000 and not os.path.exists({flag!r}): time.sleep(0.05)
    return step(self, *arguments)
Pipeline.step = stalling
import gritd.drivers.queue
gritd.drivers.queue.ReadingQueue.__init__.__defaults__ = (2000,)
"""


def test_a_stalled_loop_drops_the_oldest_and_says_so(tmp_path, seed, figure):
    flag = tmp_path / "go on"
    with service(
        tmp_path, driven(40.0, seed, skip=1.0), prelude=STALLING.format(flag=str(flag))
    ) as (_, daemon):
        daemon.wait_status(lambda report: report["queue"]["dropped"] > 0)
        daemon.heard("hanging: loop")
        daemon.heard("queue: the loop fell behind")
        flag.touch()
        report = daemon.wait_status(
            lambda report: report["loop"]["missed"] > 100 and report["status"] == "TRACKING"
        )
        counts = report["queue"]
        daemon.stop()
    assert any("hanging: loop" in line for line in log_lines(daemon.path()))
    excess = counts["received"] - counts["processed"] - counts["dropped"] - counts["queued"]
    figure(
        "queue overflow",
        f"{WIRES}, the loop made to stall",
        "readings not accounted for",
        abs(excess),
        "",
        0,
    )
    assert verified(daemon.path())
