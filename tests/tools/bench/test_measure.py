"""What is measured of the cost of things: every figure, and by the engine it names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.filter.filterpy_engine import FilterpyEngine
from gritd.tools.bench import against, diagnosis, forward, live, measure, peers
from gritd.tools.testbed.simulation import soil_of
from tests.tools.bench.samples import FIGURES

pytestmark = pytest.mark.slow

SMALL = measure.BenchSizes(
    seconds=3.0, ticks=300, repeats=1, samples=100, starts=1, simulated=3.0, live=6.0
)
SECTIONS = (
    *("tick", "replay", "forces", "update", "recording"),
    *("reading", "writing", "start", "live", "reading_live", "forward_model"),
)


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    return measure.measure(SMALL, tmp_path_factory.mktemp("bench"))


def test_every_figure_is_a_positive_number(figures):
    assert tuple(figures) == SECTIONS
    missed = figures["live"].pop("missed")
    for part in ("missed_at_work", "missed_by_both"):
        assert missed >= figures["live"].pop(part) >= 0.0
    assert all(value > 0.0 for section in figures.values() for value in section.values())


def test_the_sample_that_others_use_has_every_figure(figures):
    assert FIGURES.keys() == set(SECTIONS)
    assert all(values.keys() <= FIGURES[section].keys() for section, values in figures.items())


def test_ratios_and_shares_are_those_of_their_parts(figures):
    forces, update, tick = figures["forces"], figures["update"], figures["tick"]
    assert forces["ratio"] == pytest.approx(forces["quadrature"] / forces["closed_form"])
    assert forces["ratio_in_batch"] == pytest.approx(
        forces["quadrature_in_batch"] / forces["closed_form_in_batch"]
    )
    assert update["ratio"] == pytest.approx(update["filterpy"] / update["plain"])
    assert tick["share_of_budget"] == pytest.approx(tick["at_99_percent"] / 0.004)
    assert tick["median"] <= tick["at_99_percent"] <= tick["at_99.9_percent"] <= tick["worst"]
    assert tick["over_plain_loop"] == pytest.approx(tick["plain_loop"] / tick["median"])
    for section in (figures["reading"], figures["reading_live"], figures["writing"]):
        for name in (key.removeprefix("over_") for key in section if key.startswith("over_")):
            assert section[f"over_{name}"] == pytest.approx(section[name] / section["gritd"])
            assert section[f"{name}_best"] <= section[name] <= section[f"{name}_worst"]


def test_every_reader_that_the_tests_install_is_measured(figures):
    """Each was found to read the same messages; `reading` fails otherwise."""
    assert {"gritd", "rosbags", "mcap_ros2_support"} <= figures["reading"].keys()
    assert {"gritd", "mcap", "rosbags"} <= figures["writing"].keys()


def test_a_reader_that_leaves_messages_out_is_not_measured(tmp_path, monkeypatch):
    subject = measure._subject(SMALL, tmp_path)
    short = ("gritd", lambda path: peers.ours(path) - 1)
    monkeypatch.setattr(peers, "READERS", {**peers.READERS, "short": short})
    with pytest.raises(AssertionError, match="short"):
        against.reading(subject.logged, 1)


def test_brentq_on_8_nodes_finds_the_same_angle():
    settings = config.load(packaged()).settings
    ground = soil_of(settings)
    for slip, load in ((0.1, 40.0), (0.5, 100.0)):
        there = forward._scalar(settings.wheel, ground, slip, load)
        here = forward._scalar(settings.wheel, ground, slip, load, forward._by_nodes)
        assert here == pytest.approx(there, rel=1e-5)


def test_each_replay_runs_the_engine_it_names(tmp_path, monkeypatch):
    applied = []
    honest = FilterpyEngine.update
    monkeypatch.setattr(
        FilterpyEngine, "update", lambda *given: applied.append(1) or honest(*given)
    )
    longer = replace(SMALL, seconds=60.0)  # the filter waits until the wheel is steady
    subject = measure._subject(longer, tmp_path)
    monkeypatch.setattr(measure, "ENGINES", ("plain",))
    assert {"plain_speed", "with_ticks_speed"} <= measure.replay(subject).keys() and not applied
    monkeypatch.setattr(measure, "ENGINES", ("filterpy",))
    measure.replay(subject)
    assert applied


def test_a_start_is_that_of_a_process_of_its_own(figures):
    """Neither this process's memory nor its time: scipy is loaded here, and there for one engine
    alone.
    """
    started = figures["start"]
    assert started["plain_memory"] < 100e6 < started["filterpy_memory"] < 200e6


def test_the_daemon_at_work_is_measured_from_the_command_on(figures):
    found = figures["live"]
    assert 0.0 < found["first_tick"] < found["first_estimate"]
    assert found["ticks"] > 0 and 20e6 < found["memory"] < 200e6
    assert found["share_at_work"] < 1.0
    for name in ("lateness", "duration", "control"):
        assert found[f"{name}_median"] <= found[f"{name}_at_99_percent"] <= found[f"{name}_worst"]


def test_missed_ticks_are_the_computers_where_the_control_was_held_too():
    """Two ticks are missed at 10 ms and three at 40 ms; the control is 2.5 ms late at 9 ms, and
    half a period at 40 ms.
    """
    stamps = np.array([9, 10, 13, 14, 40, 44], np.int64) * 1_000_000
    loop = np.zeros(stamps.size, [("stamp", "i8"), ("missed", "u8")])
    loop["stamp"], loop["missed"] = stamps, (0, 0, 2, 2, 2, 5)
    deadlines = np.arange(9, 45, dtype=np.int64) * 1_000_000
    late = np.full(deadlines.size, 50_000, np.int64)
    late[0], late[31] = 2_500_000, 500_000

    found = live.beside(loop, np.column_stack((deadlines, late)), 1000.0)
    assert found["missed_by_both"] == 2.0
    assert found["control_worst"] == pytest.approx(2.5e-3)
    assert found["control_median"] == pytest.approx(5e-5)


def test_another_rate_is_that_of_the_loop_and_of_every_sensor(tmp_path):
    settings = config.load(live.at_rate(1000.0, tmp_path / "rig")).settings
    packed = config.load(packaged()).settings
    assert settings.rates.tick == 1000.0
    assert settings.channels == packed.channels and settings.filter == packed.filter


def test_a_long_recording_is_replayed_whole(tmp_path):
    found = measure.long_replay(measure.BenchSizes(long=30.0), tmp_path)
    assert found["windows"] == pytest.approx(300, abs=2)
    assert found["speed"] == pytest.approx(30.0 / (found["reading"] + found["filter"]))


def test_an_exponent_is_that_of_the_power_law():
    assert diagnosis.exponent((2.0, 4.0, 8.0), (3.0, 3.0 * 2**1.5, 3.0 * 4**1.5)) == pytest.approx(
        1.5
    )


@pytest.mark.slow
def test_a_diagnosis_is_measured_against_runs_and_length(tmp_path):
    found = diagnosis.diagnosis(tmp_path, (1, 2), (40.0, 80.0))
    assert found["1_runs_seconds"] > 0.0 and found["80_s_memory"] > 50e6
    assert {"exponent_of_runs", "exponent_of_length"} <= found.keys()
    assert found["2_runs_on_2_cores_elapsed"] > 0.0
