"""Recordings whose checkpoints somebody forged."""

from __future__ import annotations

import json
import random

import pytest

from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online import checkpoint
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.topics import CHECKPOINT, TICK_TOPIC, TOPICS
from tests.scenarios.commands import in_process
from tests.scenarios.rig import TESTBED, driven

QUICK = True
FORGED = "hostile checkpoints"
PERIOD = 4_000_000  # [ns]
NUMBERS = (None, True, "x", -1, 0, 0.5, 1e308, float("nan"), float("-inf"), 10**400, -(2**63), [])
SHAPES = ([], {}, [[]], {"dict": {}}, {"list": [1]}, {"deque": [None]}, {"Sample": [1]}, {"os": []})
TEXTS = ("", "[", "null", "1", '"x"', "[]", "{}", "[" * 100_000, '{"sync":1,"rest":[]}')


@pytest.fixture(scope="module")
def whole():
    """Seven seconds of a run: the readings of every tick, and the state after the half of them."""
    readings, ticks, taken = driven(11.0, 1, skip=4.0), [], 0
    for stamp in range(PERIOD, readings[-1].received, PERIOD):
        first = taken
        while taken < len(readings) and readings[taken].received <= stamp:
            taken += 1
        ticks.append((stamp, readings[first:taken]))

    pipeline = Pipeline(TESTBED.settings, "plain")
    state, half = pipeline.start(), len(ticks) // 2
    for stamp, batch in ticks[:half]:
        state, row = pipeline.step(state, batch, stamp)
    return ticks[half : half + 200], row, checkpoint.encode(state)


def recording(path, whole, text, configuration=TESTBED.text):
    """A part that begins with this checkpoint; what its ticks say does not matter."""
    ticks, row, _ = whole
    writer = RunWriter(path, TOPICS, TESTBED.text, RunInfo("run", part=1))
    writer.message(CHECKPOINT, 1, (1, configuration, text))
    for stamp, batch in ticks:
        for reading in batch:
            writer.reading(reading)
        writer.message(TICK_TOPIC.name, stamp, (stamp, *row[1:]))
    writer.close()


def places(plain, path=()):
    """Every place in a text that is JSON."""
    yield path
    items = plain.items() if isinstance(plain, dict) else enumerate(plain)
    for key, value in items:
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))
        else:
            yield (*path, key)


def forged(text, rng):
    """The text with one value replaced, left out or doubled."""
    plain = json.loads(text)
    *path, last = rng.choice([place for place in places(plain) if place])
    at = plain
    for key in path:
        at = at[key]
    match rng.randrange(4):
        case 0:
            at[last] = rng.choice(SHAPES)
        case 1 if isinstance(at, list):
            at.insert(last, at[last])
        case 2:
            del at[last]
        case _:
            at[last] = rng.choice(NUMBERS)
    return json.dumps(plain)


def played(path, whole, text):
    """What `replay --verify` and `replay` say of it, where that is not in order."""
    path.unlink(missing_ok=True)
    recording(path, whole, text)
    faults = []
    for option in ("--verify", "--engine=plain"):
        code, said = in_process("replay", path, option)
        wrong = [line for line in said if line.startswith("gritd: ")]
        good = code in (0, 1, 2, 3) and len(wrong) <= 1 and "internal error" not in " ".join(said)
        faults += [] if good else [(text[:60], option, code, said)]
    return faults


def test_forged_states(tmp_path, whole, figure):
    check(tmp_path, whole, 40, figure)


@pytest.mark.slow
def test_many_forged_states(tmp_path, whole, figure):
    check(tmp_path, whole, 2000, figure)


def check(folder, whole, count, figure):
    rng, faults = random.Random(1), []
    for text in (*TEXTS, *(forged(whole[2], rng) for _ in range(count))):
        faults += played(folder / "a.mcap", whole, text)
    assert not faults, (len(faults), faults[:3])
    level = "replay, with and without --verify"
    figure(FORGED, level, "forged checkpoints", count + len(TEXTS))
    figure(FORGED, level, "that end in an internal error", len(faults), limit=0)
