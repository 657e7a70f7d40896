"""`import gritd`: what Python programs and notebooks use."""

from __future__ import annotations

import doctest
import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gritd
from gritd.config import packaged
from gritd.estimator.recording import tables

STEPS = [
    {"duration": 5.0, "load": load, "slip": slip, "speed": 0.02}
    for load in (40.0, 90.0)
    for slip in (0.1, 0.3, 0.5)
]
MODULES = ("interface.runs", "interface.filtering", "interface.simulation", "terramechanics")


@pytest.fixture(scope="module")
def simulated():
    return gritd.simulate(schedule=STEPS, soil={"cohesion": 1200.0, "tan_phi": 0.55}, seed=3)


@pytest.fixture(scope="module")
def recorded(simulated, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("interface") / "run.mcap"
    simulated.write(path)
    return path


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_in_the_docstrings_are_true(name, tmp_path):
    path = tmp_path / "run.mcap"
    gritd.simulate(schedule=STEPS, seed=3).write(path)
    module = importlib.import_module(f"gritd.{name}")
    names = {"recorded": path, "configuration": packaged(), "read": gritd.read}
    failed, tried = doctest.testmod(module, extraglobs=names)
    assert failed == 0 and tried > 0


def test_import_gritd_loads_nothing_and_the_daemon_loads_no_interface():
    code = (
        "import sys, gritd; print(sorted({'numpy', 'scipy', 'matplotlib', 'gritd.estimator'} "
        "& sys.modules.keys())); import gritd.tools.service.serve; "
        "print([m for m in sys.modules if m.startswith(('gritd.interface', 'matplotlib'))])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.splitlines()[0] == "[]"
    assert "gritd.interface" not in said.stdout


def test_every_public_name_is_there_and_documented():
    for name in gritd.__all__:
        assert name.startswith("__") or getattr(gritd, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        gritd.nothing  # noqa: B018


def test_own_arrays_become_c_and_tan_phi(simulated):
    """The same arrays as a recording: the same estimate, and the truth inside 2 σ."""
    estimates = gritd.Filter(packaged()).run(simulated.arrays)
    assert estimates.believed and estimates.tracking.mean() > 0.4
    assert abs(estimates.cohesion.value - 1200.0) < 2.0 * estimates.cohesion.sigma
    assert abs(estimates.tan_phi.value - 0.55) < 2.0 * estimates.tan_phi.sigma
    assert estimates.time.shape == estimates.rows.shape


def test_a_recording_and_its_arrays_agree(simulated, recorded):
    run = gritd.read(recorded)
    assert run.info.name == "run" and run.damage == []
    own = {
        channel: (rows["stamp"] / 1e9 - rows["stamp"][0] / 1e9, rows[rows.dtype.names[-1]])
        for channel in ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt")
        for rows in [run[f"raw/{channel}"]]
    }
    assert np.array_equal(own["motor_shunt"][1], simulated.arrays["motor_shunt"][1])
    assert [each.path for each in gritd.read([recorded, recorded])] == [recorded, recorded]


def test_every_topic_of_a_run_is_what_a_pass_for_it_alone_gives(recorded, monkeypatch):
    at_once = gritd.read(recorded)
    monkeypatch.setattr(tables, "ROOM", 0)
    one_by_one = gritd.read(recorded)
    assert sorted(at_once) == sorted(one_by_one) != []
    for topic in at_once:
        np.testing.assert_array_equal(at_once[topic], one_by_one[topic])
        at_once[topic]["log_time"] += 1  # they are the caller's
        one_by_one[topic]["log_time"] += 1


def test_a_run_after_another_on_the_same_bed_knows_more(simulated):
    filter = gritd.Filter(packaged())
    first = filter.run(simulated.arrays)
    second = filter.run(simulated.arrays, after=first)
    assert second.tan_phi.sigma < first.tan_phi.sigma


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"shunt": ([0.0], [1.0])}, "shunt: no channel; expected one of wheel_encoder"),
        ({"motor_shunt": ([0.0, 1.0], [1.0])}, "motor_shunt: found times"),
        ({"wrench": ([0.0], [[1.0, 2.0]])}, "expected .n,. and .n, 6."),
    ],
)
def test_arrays_that_do_not_fit_are_told_in_a_line(arrays, words):
    with pytest.raises(ValueError, match=words):
        gritd.Filter(packaged()).run(arrays)


@pytest.mark.long
def test_a_diagnosis_draws_itself_in_a_notebook(tmp_path):
    runs = [
        gritd.simulate(
            schedule=[{**step, "load": load} for step in STEPS[:3]],
            effects={"coulomb_friction": {"loss": 0.4}},
            seed=int(load),
        ).write(tmp_path / f"{load:g}.mcap")
        for load in (40.0, 70.0, 100.0)
    ]
    result = gritd.diagnose(runs, packaged())
    assert result.verdict == "explained" and "coulomb_friction" in result.accepted
    assert "<iframe" in result._repr_html_() and "Coulomb" in result._repr_html_()
    assert result.report(tmp_path / "r.html").exists() and "verdict" in str(result)


def test_an_estimate_that_is_not_believed_says_so():
    """A friction that the filter knows nothing of: what is reported is the prior."""
    run = gritd.simulate(schedule=STEPS, effects={"coulomb_friction": {"loss": 1.0}}, seed=3)
    estimates = gritd.Filter(packaged()).run(run.arrays)
    assert not estimates.believed


def test_what_a_notebook_shows_of_a_value_is_one_line(simulated, recorded):
    run = gritd.read(recorded)
    assert "run.mcap" in repr(run) and "topics" in repr(run)
    for shown in (repr(run), repr(simulated), repr(gritd.Filter(packaged()).run(run))):
        assert "\n" not in shown and len(shown) < 200 and "prior" not in shown


@pytest.mark.parametrize(
    ("wrong", "reported"),
    [
        (lambda: gritd.simulate(schedule=[{"duration": 5.0}]), "segment 1: found duration"),
        (lambda: gritd.simulate(packaged(), []), "found no segments; expected .duration, load"),
        (lambda: gritd.simulate(schedule=STEPS, soil={"cohesio": 1.0}), "did you mean cohesion"),
        (lambda: gritd.diagnose([], packaged()), "runs: found none"),
        (lambda: gritd.diagnose("run.mcap", packaged()), "expected a list"),
        (lambda: gritd.Filter(packaged()).run({"wheel_encoder": ([0.0], [1])}), "both encoders"),
        (
            lambda: gritd.Filter(packaged()).run(
                {"wheel_encoder": ([0.0, np.nan], [1, 2]), "carriage_encoder": ([0.0], [1])}
            ),
            "not finite",
        ),
    ],
)
def test_a_mistake_is_one_line_that_says_what_was_expected(wrong, reported):
    with pytest.raises(ValueError, match=reported) as error:
        wrong()
    assert "\n" not in str(error.value)
