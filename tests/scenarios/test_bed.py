"""Runs of the daemon on one bed add up, and each of them can be verified."""

from __future__ import annotations

import json
import shutil
import time

import pytest

from gritd.estimator.daemon import bed_file
from gritd.estimator.filter.estimate import KPA
from tests.scenarios import rig
from tests.scenarios.recorded import rows, verified

BED = "bed file that cannot be, or of another time"
UPDATES = 20  # more of them in every run; how many more, and where, the computer's load decides


def run(folder, skip):
    """One run of the daemon until its filter has been updated often; its process, ended. All are
    on one soil, and begin `skip` [s] into the same drive.
    """
    with rig.service(folder, rig.driven(40.0, 1, skip), bed={"name": "box"}) as (_, daemon):
        daemon.wait_status(lambda report: report["tick"] and report["tick"]["updates"] > UPDATES)
        daemon.stop()
    return daemon


def test_a_run_begins_with_what_the_run_before_it_knows(tmp_path):
    folders = [tmp_path / "first", tmp_path / "second"]
    for folder in folders:
        folder.mkdir()

    first = run(folders[0], 0.0)
    shutil.copyfile(bed_file.path_of(folders[0]), bed_file.path_of(folders[1]))
    second = run(folders[1], 5.0)

    assert "bed 'box': begins with the stated prior: no run on it yet" in first.text
    assert "bed 'box': begins with what 1 runs know" in second.text
    assert bed_file.load(folders[1]).runs == 2

    assert verified(first.path()) and verified(second.path())

    left = bed_file.load(folders[0]).known.estimate
    ended, begun = (rows(daemon.path(), "/tick")[at] for daemon, at in ((first, -1), (second, 0)))
    prior = rig.TESTBED.settings.soil
    assert begun["cohesion"] == pytest.approx(left.x[0] * KPA)
    assert begun["tan_phi"] == pytest.approx(left.x[1])
    for name, stated in (("cohesion", prior.cohesion), ("tan_phi", prior.tan_phi)):
        sigma = begun[f"{name}_sigma"]
        assert sigma < stated.sigma
        assert abs(begun[name] - ended[name]) < sigma


def test_a_bed_file_that_cannot_be(tmp_path, figure):
    check(tmp_path, figure, ['{"name": "box", "updated": 17'])


@pytest.mark.slow
def test_every_bed_file_that_cannot_be(tmp_path, figure):
    before = tmp_path / "before"
    before.mkdir()
    run(before, 0.0)
    text = bed_file.path_of(before).read_text()
    changed = [sealed_anew(text, **change) for change in CHANGES]
    check(tmp_path, figure, [text[: len(text) // 2], "", text.replace("1", "2", 1), *changed])


def check(folder, figure, contents):
    """The run begins with the stated prior, and says so in one line."""
    silent = [n for n, content in enumerate(contents) if not begins_anew(folder / str(n), content)]
    figure(BED, rig.WIRES, "files", len(contents))
    figure(BED, rig.WIRES, "not said in one line, or believed", len(silent), limit=0)


MONTH = 30 * 86_400.0  # [s]
CHANGES = (
    {"c": 900e3},  # [kPa]
    {"c": float("nan")},
    {"variance": -1.0},
    {"variance": 1e12},
    {"age": MONTH},
    {"age": -MONTH},
)


def sealed_anew(text, c=None, variance=None, age=None):
    """A bed file with another value."""
    plain = json.loads(text)
    del plain[bed_file.SEAL]
    for member in plain["members"]:
        member["x"][0] = member["x"][0] if c is None else c
        member["P"][0][0] = member["P"][0][0] if variance is None else variance
    if age is not None:
        plain["updated"] = time.time() - age
    return json.dumps(bed_file._sealed(plain))


def begins_anew(folder, content):
    """Whether a run in the folder with this bed file tells of the stated prior, in one line, and
    begins with it.
    """
    folder.mkdir()
    bed_file.path_of(folder).write_text(content)
    with rig.Wires(folder, bed={"name": "box"}) as wires, rig.DaemonProcess(wires.config) as daemon:
        daemon.ready()
        daemon.stop()
    prior = rig.TESTBED.settings.soil.cohesion
    reported = daemon.lines("begins with the stated prior")
    first = rows(daemon.path(), "/tick")[0]
    return len(reported) == 1 and first["cohesion"] == prior.value and verified(daemon.path())
