"""A sensor that is louder than stated is named, with the noise to state; no other one is."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.messages.readings import NS
from gritd.estimator.plausibility.driven import Raw, driven
from gritd.estimator.plausibility.noise import AXES
from gritd.estimator.plausibility.words import louder

TESTBED = load(packaged()).settings
CHANNELS = ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt")
COUNT = 2000
EVERY = 4_000_000  # [ns]


def readings(times: dict[str, float], seed: int) -> dict[str, Raw]:
    """Steady driving, of which each channel or axis is so many times as loud as stated; a spike in
    a hundred readings of what is no encoder.
    """
    draw = np.random.default_rng(seed)
    stamps = 10 * NS + EVERY * np.arange(COUNT)

    def values(name: str, stated: float) -> np.ndarray:
        return draw.normal(0.0, times.get(name, 1.0) * stated, COUNT)

    noise = {name: TESTBED.channels[name].noise for name in CHANNELS}
    made = {name: values(name, noise[name]) for name in CHANNELS}
    for name, rate in zip(CHANNELS, (250.0, 90.0), strict=False):
        made[name] = np.round(made[name] + rate * stamps / NS).astype(np.int64)
    for name in CHANNELS[2:]:
        made[name] += 2.0 + 50.0 * noise[name] * (draw.random(COUNT) < 0.01)

    assert TESTBED.wrench is not None
    wrench = np.zeros((COUNT, 6))
    for at, name in enumerate(("fx", "fy", "fz", "tx", "ty", "tz")):
        if name in AXES:
            wrench[:, at] = values(name, getattr(TESTBED.wrench, AXES[name][0]))
    raw = {name: Raw(stamps, column) for name, column in made.items()}
    return raw | {"wrench": Raw(stamps, wrench)}


@given(
    loud=st.sets(st.sampled_from((*CHANNELS, *AXES))),
    times=st.floats(2.5, 30.0),
    seed=st.integers(0, 1000),
)
def test_the_noise_to_state_is_that_of_the_sensor(loud: set[str], times: float, seed: int) -> None:
    raw = readings(dict.fromkeys(loud, times), seed)
    told = list(louder([(driven("run", raw, TESTBED, None), TESTBED)]))

    assert {
        name for name in (*CHANNELS, *AXES) if any(f" {name} " in line for line in told)
    } == loud
    assert len(told) == len(loud)
    for line in told:
        found = float(re.findall(r"([\d.]+) times", line)[0])
        assert found == np.clip(found, 0.85 * times, 1.2 * times)
