"""Every allocation of the hot path fails once: in what the writer is handed, in what it writes, in
a tick. Nothing that was written is lost, every message is accounted for, nothing hangs.
"""

from __future__ import annotations

import pytest

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online.checkpoint import decode, encode
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import LOG_TOPIC, TOPICS
from gritd.estimator.recording.writer import WriterThread
from tests.estimator.filter.rig import RIG, TRUTH
from tests.linear_plant import THREE_LOADS, readings
from tests.scenarios.memory import enough, failing

QUICK = True
MEMORY = "every allocation of the hot path fails once"
WRITER = "writer, without its threads"
STEPS = [23, pytest.param(1, marks=pytest.mark.slow)]  # one place in so many
READINGS = [Reading(10**9 + i, "wheel_encoder", 1000 + i, 10**9 + i) for i in range(60)]


def line(number):
    stamp = 10**9 + number
    return LOG_TOPIC.name, stamp, (stamp, 20, "gritd", f"line {number}", "", "", 0)


def put(writer):
    writer.put(READINGS[20:40], [line(1)])


def write(writer):
    writer._attempt(writer._write_out)
    return writer.status().state == "writing"


def finish(writer):
    writer._attempt(writer._finish)
    return writer.status().state == "closed"


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("what", [put, write, finish])
def test_the_writer(tmp_path, what, step, figure):
    """Before it 21 messages, in it 21, after it 21: what is said to be written is in the files."""
    made = []

    def prepared():
        made.append(tmp_path / f"{len(made)}.mcap")
        writer = WriterThread(made[-1], TOPICS, "a: 1\n", RunInfo("run"))
        writer.put(READINGS[:20], [line(0)])
        write(writer)
        if what is not put:
            put(writer)
        return writer

    places, missing, dropped = range(0, enough(prepared, what), step), 0, 0
    for number in places:
        writer = prepared()
        failing(number, lambda writer=writer: what(writer))
        if what is not finish:
            writer._attempt(writer._write_out)
            writer.put(READINGS[40:], [line(2)])
        last = writer.stop(0.0)
        found = [read(path, TOPICS) for path in last.files]

        assert last.accepted == last.written + last.dropped + last.queued, number
        assert not any(recording.damage for recording in found), number
        in_files = sum(sum(recording.counts.values()) for recording in found)
        assert in_files <= last.written, f"{number}: more in the files than was counted"
        missing, dropped = missing + last.written - in_files, dropped + last.dropped

    level = f"{WRITER}, {what.__name__}"
    figure(MEMORY, level, "messages written and not in the files", missing, "", 0)
    figure(MEMORY, level, "messages dropped and counted, for each failure", dropped / len(places))


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("engine", ["plain", "filterpy"])
def test_a_tick(engine, step, figure):
    """It raises, which ends the daemon with a line, or it is the tick that it would have been."""
    pipeline, batches = Pipeline(RIG, engine), list(readings(RIG, TRUTH, THREE_LOADS, seed=1))
    state = pipeline.start()
    for t, batch in batches[:100]:
        state, _ = pipeline.step(state, batch, t)
    text, (t, batch) = encode(state), batches[100]

    def prepared():
        return decode(text, pipeline.settings)

    def tick(state):
        return pipeline.step(state, batch, t)[1]

    expected, wrong = repr(tick(prepared())), 0
    for number in range(0, enough(prepared, tick), step):
        state = prepared()
        found = failing(number, lambda state=state: tick(state))
        wrong += not isinstance(found, Exception) and repr(found) != expected
    figure(MEMORY, f"pipeline, engine {engine}", "ticks that are another", wrong, "", 0)
