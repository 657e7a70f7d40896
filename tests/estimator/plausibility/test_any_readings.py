"""Whatever a recording holds, what is said of it is lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.plausibility.driven import Raw, driven
from gritd.estimator.plausibility.mistakes import OF_A_RECORDING
from gritd.estimator.plausibility.words import sentences

TESTBED = load(packaged()).settings
MOST = 4_000_000_000_000_000_000
stamps = st.lists(st.integers(0, MOST), min_size=1, max_size=40, unique=True).map(
    lambda given: np.array(sorted(given), dtype=np.int64)
) | st.integers(1, 10**9).map(lambda step: np.arange(60, dtype=np.int64) * step)
steps = st.sampled_from([0, 1, 7, 10**6, -(10**6), 10**12])
numbers = st.floats(allow_nan=True, allow_infinity=False, width=64)


@st.composite
def readings(draw: st.DrawFn, channel: str) -> Raw:
    at = draw(stamps)
    if channel.endswith("encoder"):
        return Raw(at, np.arange(at.size, dtype=np.int64) * draw(steps) + draw(steps))
    shape = (at.size, 6) if channel == "wrench" else (at.size,)
    return Raw(at, draw(arrays(np.float64, shape, elements=numbers)))


CHANNELS = ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt", "wrench")


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_any_readings_make_lines(data: st.DataObject) -> None:
    present = data.draw(st.sets(st.sampled_from(CHANNELS)))
    raw = {name: data.draw(readings(name)) for name in sorted(present)}
    auto = data.draw(st.booleans())
    configured = replace(TESTBED, rates=replace(TESTBED.rates, auto=auto))

    run = driven("run", raw, configured, data.draw(st.none() | st.floats(1.0, 1e6)))
    lines = list(sentences([(run, configured)], OF_A_RECORDING))
    assert len(lines) >= 3 and all(line.count("\n") == 0 for line in lines)
    assert all(len(line) <= 300 for line in lines[3:])
