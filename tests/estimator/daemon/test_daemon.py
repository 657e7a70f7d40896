"""The daemon with devices that are simulated in its own process: what ends it, and what it says."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.daemon.clock import Clock
from gritd.estimator.daemon.daemon import Daemon, DaemonError
from gritd.estimator.daemon.loop import Loop
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import LOG_TOPIC

TESTBED = config.load(packaged())
TEXT = 3  # place of the text in a /log message
LIMIT = 600.0  # [s] ends a test that has failed


class StandingReader:
    inside = ""

    """A device whose thread lives until it is stopped, or until `unplug`."""

    def __init__(self, device="encoders"):
        self.device, self.beats, self.alive = device, 0, False

    def start(self):
        self.alive = True

    def stop(self, timeout):
        self.alive = False
        return True

    def unplug(self):
        self.alive = False


class Readings:
    """Where readings come from: none, or an exception in the loop's thread."""

    def __init__(self):
        self.fails = False

    def drain(self):
        if self.fails:
            raise ZeroDivisionError("float division by zero")
        return []

    def dropped(self):
        return 0


class SteppingClock(Clock):
    """Somebody sets the wall clock."""

    step = 0.0

    def wall_offset(self):
        return super().wall_offset() + self.step


class Bench:
    """A daemon, what it is made of, and what its recording says afterwards."""

    def __init__(self, folder):
        self.reader, self.source, self.clock = StandingReader(), Readings(), SteppingClock()
        self.path = folder / "run.mcap"
        run = RunInfo("run")
        self.daemon = Daemon(TESTBED, self.path, run, [self.reader], self.source, self.clock)
        self._began = time.monotonic()

    def serve(self, act=lambda daemon: None, until=lambda daemon: False):
        """Run; `act` at every look once the loop ticks, stopped when `until` holds."""

        def watch(daemon):
            if daemon.loop.ticks > 10:
                act(daemon)
            if until(daemon) or time.monotonic() - self._began > LIMIT:
                daemon.stop()

        return self.daemon.serve(watch)

    def lines(self):
        """The texts of /log; the recording must be whole."""
        every = [read(part) for part in parts(self.path)]
        assert all(part.complete and not part.damage for part in every)
        return [
            values[TEXT]
            for part in every
            for topic, _, values in part.messages()
            if topic == LOG_TOPIC.name
        ]


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def test_it_ends_by_name_where_a_reader_dies(bench):
    with pytest.raises(DaemonError, match="encoders") as error:
        bench.serve(lambda daemon: bench.reader.unplug())
    assert bench.lines()[-1] == str(error.value)


def test_it_ends_by_name_where_the_loop_fails(bench):
    said = "the loop failed: ZeroDivisionError: float division by zero"
    with pytest.raises(DaemonError, match=f"^{said}$"):
        bench.serve(lambda daemon: setattr(bench.source, "fails", True))
    assert bench.lines()[-1] == said  # not "thread died", which follows from it


def test_it_ends_by_name_where_the_watch_fails(bench):
    def watch(daemon):
        raise KeyError("devices")

    with pytest.raises(DaemonError, match="KeyError") as error:
        bench.serve(watch)
    assert bench.lines()[-1] == str(error.value)


def test_a_wall_clock_that_is_set_is_a_line_each_time_and_the_stamps_go_on(bench):
    steps = iter([3600.0, 3600.0, 0.0])
    looks = []

    def act(daemon):
        looks.append(bench.clock.step)
        bench.clock.step = next(steps, 0.0)

    last = bench.serve(act, until=lambda daemon: len(looks) >= 6)
    assert last.state == "closed"
    reported = [line for line in bench.lines() if line.startswith("wall clock stepped by ")]
    assert [line.split(".")[0] for line in reported] == [
        "wall clock stepped by +3600",
        "wall clock stepped by -3600",
    ]
    stamps = read(bench.path).arrays("/tick")["stamp"]
    assert (stamps[1:] > stamps[:-1]).all()


def other_wheel():
    wheel = TESTBED.settings.wheel
    return replace(TESTBED.settings, wheel=replace(wheel, radius=1.01 * wheel.radius))


def test_the_same_configuration_again_is_no_change(bench):
    assert bench.daemon.change_to(config.load(packaged())) is None


def test_a_change_of_the_wheel_is_refused_by_name_and_one_of_the_filter_begins_a_part(bench):
    wider = replace(TESTBED, text=TESTBED.text + "\n", settings=other_wheel())
    with pytest.raises(DaemonError, match=r"wheel: changed, which needs a restart$"):
        bench.daemon.change_to(wider)

    other = replace(TESTBED, text=TESTBED.text + "\n")
    change = bench.daemon.change_to(other)
    asked = []

    def act(daemon):
        if not asked:
            asked.append(daemon.reload(other, change))

    bench.serve(act, until=lambda daemon: len(daemon.writer.status().files) > 1)
    assert len(parts(bench.path)) == 2
    assert [read(part).config_yaml for part in parts(bench.path)] == [TESTBED.text, other.text]


def test_a_run_that_has_not_begun_has_no_lateness():
    loop = Loop(Pipeline(TESTBED.settings), Readings(), None, Clock())
    assert loop.lateness() == {} and loop.ticks == 0
