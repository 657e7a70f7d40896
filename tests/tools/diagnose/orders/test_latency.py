"""How late a channel is: by a time, apart from a length of travel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import make
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.diagnose.orders.latency import Event, Latency, changes, events, lag_of, latency_of
from gritd.tools.diagnose.rig.latencies import latencies_in
from gritd.tools.diagnose.rig.signals import read_all, signals
from gritd.tools.testbed.run_files import write
from gritd.tools.testbed.simulation import simulate_run
from tests.tools.diagnose.campaigns import plan, settings, soil

STEP = 0.02  # [s]
TIME = np.arange(0.0, 4.0, STEP)
RAMP = np.interp(TIME, [0.0, 1.5, 2.0, 4.0], [1.0, 1.0, 3.0, 3.0])


@pytest.mark.parametrize("lag", [-0.12, 0.0, 0.03, 0.3])
def test_the_lag_of_a_ramp_comes_back_whatever_level_and_size(lag: float) -> None:
    rng = np.random.default_rng(1)
    read = 5.0 + 0.7 * np.interp(TIME - lag, TIME, RAMP) + 0.01 * rng.standard_normal(TIME.size)
    found = lag_of(TIME, read, RAMP, np.full(TIME.size, 0.02))
    assert found is not None
    assert abs(found.lag - lag) < 3.0 * found.sigma
    assert found.sigma < 0.02


def test_a_channel_that_does_something_else_has_no_lag() -> None:
    noise = np.random.default_rng(2).standard_normal(TIME.size)
    assert lag_of(TIME, noise, RAMP, np.full(TIME.size, 0.02)) is None
    assert lag_of(TIME, -RAMP, RAMP, np.full(TIME.size, 0.02)) is None


def test_events_are_where_something_changes() -> None:
    (window,) = events(changes(RAMP, STEP), STEP)
    assert TIME[window.start] < 1.0 and TIME[window.stop] > 2.5
    assert events(changes(np.ones(TIME.size), STEP), STEP) == []


def _told(delay: float, length: float, speeds: tuple[float, ...], seed: int = 3) -> Latency:
    rng = np.random.default_rng(seed)
    lags = [delay + length / v + 0.01 * rng.standard_normal() for v in speeds]
    found = latency_of("sinkage", [Event(x, 0.01, v) for x, v in zip(lags, speeds, strict=True)])
    assert found is not None
    return found


def test_a_time_and_a_length_are_told_apart_by_the_speed() -> None:
    speeds = (0.01, 0.01, 0.02, 0.02, 0.03, 0.03, 0.04, 0.04)
    late, soft = _told(0.15, 0.0, speeds), _told(0.0, 2e-3, speeds)
    assert abs(late.delay - 0.15) < 3.0 * late.delay_sigma and late.sure
    assert abs(late.length) < 3.0 * late.length_sigma
    assert abs(soft.length - 2e-3) < 3.0 * soft.length_sigma and not soft.sure


def test_at_one_speed_nothing_is_sure() -> None:
    assert not _told(0.15, 0.0, (0.02,) * 8).sure
    few = [Event(0.1, 0.01, v) for v in (0.01, 0.02, 0.03)]
    assert latency_of("sinkage", few) is None


@pytest.mark.parametrize(
    ("acting", "late"),
    [
        ((), {}),
        ((("sensor_latency", {"current": 0.08}),), {"torque": 0.08}),
        (
            (("sensor_latency", {"force": -0.06}),),
            {"drawbar_pull": -0.06, "axle_torque": -0.06},
        ),
        ((("contact_relaxation", {"forces": 1.0, "sinkage": 1.0, "length": 0.03}),), {}),
    ],
    ids=["nothing", "current", "force", "relaxation"],
)
def test_a_late_sensor_is_told_of_recordings(
    acting: tuple[tuple[str, dict[str, float]], ...], late: dict[str, float], tmp_path: Path
) -> None:
    """Not a contact that follows over a length of travel."""
    found = {x.channel: x for x in _latencies(tmp_path, [make(*each) for each in acting])}
    assert {name for name, x in found.items() if x.sure} == set(late)
    for name, delay in late.items():
        assert found[name].delay == pytest.approx(delay, abs=0.015)


def _latencies(folder: Path, acting: Any) -> tuple[Latency, ...]:
    configured, files = config.load(packaged()), []
    for number, motion in enumerate((drawn := plan(stop=True)).motions):
        motion = replace(motion, time=np.asarray(motion.time) - np.asarray(motion.time)[0])
        run = simulate_run(settings(), soil(), motion, acting, number)
        files.append(folder / f"run-{number}.mcap")
        info = RunInfo(name=f"run-{number}", nominal_load=drawn.weights[number])
        write(files[-1], configured, info, run)
    recordings = read_all(files)
    on_grid = [signals(recording, settings(), 10.0) for recording in recordings]
    return latencies_in(recordings, on_grid, settings())
