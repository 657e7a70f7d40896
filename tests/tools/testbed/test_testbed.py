"""The simulated testbed: what goes onto its wires comes out of the drivers, and teaches the filter
the soil.
"""

from __future__ import annotations

import subprocess
import sys
import time
from itertools import pairwise

import numpy as np
import pytest

from gritd.config import packaged
from gritd.drivers.build import build_readers
from gritd.drivers.queue import ReadingQueue
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.status import Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from gritd.tools.testbed import plant, rig_config
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.simulation import soil_of
from gritd.tools.testbed.testbed import experiment, in_transit
from gritd.tools.testbed.wires import ConnectedDevices, has_multicast
from tests.drivers.rig import Ticking, wait_until

pytestmark = pytest.mark.long

TESTBED = config.load(packaged())
NS = 1_000_000_000
HELD_UP = 0.25  # [s]
TICK = 4_000_000  # [ns]
ARRIVES = 20.0  # [s] the limit only ends a test that fails
HELD_BACK = 15e6  # [ns] what is held back by more may look like a step of its clock
RESOLUTION = {
    "sinkage_pot": 1e-6,
    "motor_shunt": 1e-6,
    "motor_temperature": 0.005,
}  # of the wire, half a step
WRENCH_RESOLUTION = (0.01, 0.01, 0.01, 0.001, 0.001, 0.001)

buses = pytest.mark.parametrize(
    "bus",
    [
        pytest.param(
            "udp_multicast",
            marks=pytest.mark.skipif(not has_multicast(), reason="no interface takes multicast"),
        ),
        "slcan",
    ],
)


class Daemon:
    """The daemon's readers on the devices of a configuration file, and what they have read."""

    def __init__(self, path):
        self.settings = config.load(path).settings
        self.queue = ReadingQueue()
        self.readers = build_readers(self.settings, Ticking(), self.queue)
        self.readings = []

    def __enter__(self):
        for reader in self.readers:
            reader.start()
        assert wait_until(lambda: all(reader.stats().state == "OPEN" for reader in self.readers))
        return self

    def __exit__(self, *error):
        for reader in self.readers:
            assert reader.stop(2.0)

    def take(self):
        self.readings += self.queue.drain()
        return len(self.readings)


def by_channel(readings):
    found = {}
    for reading in readings:
        found.setdefault(reading.channel, []).append(reading)
    return found


def assert_same_values(sent, received):
    """Value for value, to the resolution of the wire; counts exactly, but for where the 32-bit
    counter began.
    """
    assert sent.keys() == received.keys()
    for channel, readings in sent.items():
        expected, found = (
            [np.array(r.value) for r in side] for side in (readings, received[channel])
        )
        if channel.endswith("encoder"):
            expected, found = np.array(expected) - expected[0], np.array(found) - found[0]
        step = RESOLUTION.get(channel, WRENCH_RESOLUTION if channel == "wrench" else 0)
        assert np.all(np.abs(np.array(expected) - np.array(found)) <= np.array(step) * 1.01), (
            channel
        )


def assert_nearly_all_and_nothing_else(sent, received):
    """For real time on a computer that may be busy: a wire nobody reads for a third of a second
    loses frames.
    """
    assert sent.keys() == received.keys()
    for channel, readings in sent.items():
        assert 0.8 * len(readings) <= len(received[channel]) <= len(readings)
        if channel.endswith("encoder"):
            assert {r.value % 2**32 for r in received[channel]} <= {
                r.value % 2**32 for r in readings
            }


@buses
def test_every_reading_arrives_as_it_was_sent(bus, tmp_path):
    """Where the computer stands still at either end of the wire, what it holds back may be taken
    for a wrong clock: then they are sent again, up to three times.
    """
    readings = in_transit(experiment(TESTBED, 8.0, "linear", 3).run.readings, 0)[6000:6900]
    for attempt in range(3):
        received, lost, late = sent(readings, bus, tmp_path / str(attempt))
        if late < HELD_BACK or len(received) == len(readings):
            break

    assert not any(lost.values())
    assert_same_values(by_channel(readings), by_channel(received))


def sent(readings, bus, folder):
    """What is read of them, up to the first that does not arrive; what did not go onto the wires;
    how late they went or were read, at most [ns].
    """
    folder.mkdir()
    late = 0

    def since(reading):
        return time.monotonic_ns() - begin - reading.stamp

    with ConnectedDevices(TESTBED.settings, bus) as rig:
        path = rig_config.write(TESTBED, rig.devices, "linear", folder)
        with Daemon(path) as daemon:
            begin = time.monotonic_ns() - readings[0].stamp
            for start in range(0, len(readings), 30):  # no faster than the wires' buffers
                part = readings[start : start + 30]
                # nor than the devices: a device whose clock runs ahead of ours is not believed
                wait_until(lambda last=part[-1]: since(last) >= 0)
                late = max(late, since(part[-1]))
                for reading in part:
                    rig.send(reading)
                gone = start + len(part)
                if not wait_until(lambda gone=gone: daemon.take() >= gone, ARRIVES):
                    break
                late = max(late, since(part[-1]))
    return daemon.readings, rig.lost, late


def test_a_process_of_its_own_plays_in_real_time_and_the_filter_learns_the_soil(tmp_path):
    command = [
        sys.executable,
        "-m",
        "gritd.tools.testbed.testbed",
        "--folder",
        str(tmp_path),
        "--wait",
        "--plant",
        "linear",
    ]
    with subprocess.Popen(
        [*command, "--seconds", "20", "--seed", "3"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        path = process.stdout.readline().strip().partition(" ")[2]
        with Daemon(path) as daemon:
            start = time.monotonic()
            print("play", file=process.stdin, flush=True)
            assert wait_until(lambda: daemon.take() and process.poll() is not None, 300.0)
            assert process.returncode == 0
            elapsed = time.monotonic() - start
            wait_until(lambda: daemon.take() == daemon.take(), 1.0)

    if (pause := longest_silence(daemon.readings)) > HELD_UP:
        pytest.skip(
            f"this computer was held up for {pause:.2f} s, which overflows the wires: "
            "nothing to learn from it"
        )
    prepared = experiment(TESTBED, 20.0, "linear", 3)
    assert elapsed >= prepared.run.motion.time[-1]
    assert_nearly_all_and_nothing_else(
        by_channel(prepared.run.readings), by_channel(daemon.readings)
    )

    ticks = pipeline_over(daemon.settings, daemon.readings)
    assert sum(tick["status"] == Status.TRACKING for tick in ticks) > 500

    for name in ("cohesion", "tan_phi"):
        truth, last, before = getattr(prepared.soil, name), ticks[-1], ticks[0]
        assert abs(last[name] - truth) < 3.0 * last[f"{name}_sigma"]
        assert last[f"{name}_sigma"] < 0.95 * before[f"{name}_sigma"]


def longest_silence(readings):
    """[s]"""
    return (
        max(
            b.received - a.received for a, b in pairwise(sorted(readings, key=lambda r: r.received))
        )
        * 1e-9
    )


def pipeline_over(settings, readings):
    """Ticks at 250 Hz over what was read, as if every reading had come when it was taken."""
    pipeline = Pipeline(settings, "plain")
    state, ticks = pipeline.start(), []
    readings = sorted((r._replace(received=r.stamp) for r in readings), key=lambda r: r.stamp)
    due = 0

    for t in range(readings[0].stamp + TICK, readings[-1].stamp, TICK):
        batch = []
        while readings[due].stamp <= t:
            batch.append(readings[due])
            due += 1
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))

    return ticks


def test_the_configuration_stands_alone_in_its_folder(tmp_path):
    with ConnectedDevices(TESTBED.settings, "slcan") as rig:
        path = rig_config.write(TESTBED, rig.devices, "linear", tmp_path)
        written = config.load(path).settings
        assert written.devices["encoders"].port == rig.devices["encoders"].port
        assert written.devices["bus"].interface == "slcan"
    assert written.devices["bus"].dbc == str(tmp_path / "testbed.dbc")
    assert written.logging.directory == str(tmp_path)
    assert written.channels == TESTBED.settings.channels and written.soil == TESTBED.settings.soil


def test_only_the_linear_plant_runs_without_the_correction_of_the_closed_forms(tmp_path):
    names = {}
    with ConnectedDevices(TESTBED.settings, "slcan") as rig:
        for kind in ("linear", "original"):
            (tmp_path / kind).mkdir()
            path = rig_config.write(TESTBED, rig.devices, kind, tmp_path / kind)
            (effect,) = config.load(path).settings.effects
            names[kind] = effect.parameters["share"].value
    assert names == {"linear": 0.0, "original": 1.0}


@pytest.mark.parametrize("seconds", [5.0, 8.0, 20.0, 60.0, 300.0])
def test_a_schedule_fills_the_time_with_three_loads_and_ends_at_rest(seconds):
    motion = motion_of(plant.schedule(seconds), TESTBED.settings.wheel.radius, 250.0)
    inside = motion.time < seconds
    assert motion.time[-1] > seconds + 1.0 and motion.wheel_speed[-1] == 0.0
    assert set(np.unique(motion.load)) >= set(plant.LOADS)
    assert np.all(motion.wheel_speed[inside & (motion.time > plant.REST)] > 0.0)


def test_slips_of_a_minute_span_5_to_60_percent_at_every_load():
    segments = plant.schedule(60.0).segments[1:-1]
    for load in plant.LOADS:
        slips = [segment.slip for segment in segments if segment.load == load]
        assert min(slips) == 0.05 and max(slips) == 0.6 and len(slips) == 5


@pytest.mark.parametrize("seed", range(20))
def test_a_drawn_soil_is_about_a_sigma_off_and_k_10_to_15_percent(seed):
    prior = TESTBED.settings.soil
    soil = plant.drawn_soil(TESTBED.settings, np.random.default_rng(seed))
    for value, known in ((soil.cohesion, prior.cohesion), (soil.tan_phi, prior.tan_phi)):
        assert 0.79 < abs(value - known.value) / known.sigma < 1.21
    assert 0.099 < abs(soil.shear_modulus / prior.shear_modulus.value - 1.0) < 0.151


def test_the_linear_plant_carries_the_load_by_eq_21():
    settings = TESTBED.settings
    soil = soil_of(settings)
    motion = motion_of(plant.schedule(20.0), settings.wheel.radius, 50.0)
    response = plant.linear_response(settings, soil, motion)

    for i in range(100, motion.time.size, 97):
        theta_m = settings.wheel.c1 * response.theta_1[i]
        drop = settings.wheel.radius * (np.cos(theta_m) - np.cos(response.theta_1[i]))
        sigma_m = soil.modulus * drop**soil.exponent
        known = (settings.wheel, soil.cohesion, soil.tan_phi, soil.shear_modulus)
        forces = plant.linear.forces(*known, response.theta_1[i], response.slip[i], sigma_m)
        assert forces.load == pytest.approx(motion.load[i], rel=1e-9)
        assert forces.torque * np.sign(motion.wheel_speed[i]) == pytest.approx(
            response.torque[i], rel=1e-6, abs=1e-9
        )

    assert not response.overloaded.any()


def test_delays_on_the_way_never_let_a_reading_arrive_before_it_was_taken():
    sent = experiment(TESTBED, 5.0, "linear", 1).run.readings
    moved = in_transit(sent, 4)
    assert len(moved) == len(sent) and all(r.received > r.stamp for r in moved)
    assert all(a.received <= b.received for a, b in pairwise(moved))
