"""Runs of the daemon on one bed add up, and each of them can be verified."""

from __future__ import annotations

import shutil

from gritd.estimator.daemon import bed_file
from tests.scenarios.rig import driven, rows, service, verified


def run(folder, seed):
    """One run of the daemon until its filter has been updated often; its process, ended."""
    with service(folder, driven(8.0, seed), bed={"name": "box"}) as (_, daemon):
        daemon.wait_status(lambda report: report["tick"] and report["tick"]["updates"] > 20)
        daemon.stop()
    return daemon


def test_a_run_begins_with_what_the_run_before_it_knows(tmp_path):
    folders = [tmp_path / "first", tmp_path / "second"]
    for folder in folders:
        folder.mkdir()

    first = run(folders[0], 1)
    shutil.copyfile(bed_file.path_of(folders[0]), bed_file.path_of(folders[1]))
    second = run(folders[1], 2)

    assert "bed 'box': begins with the stated prior: no run on it yet" in first.text
    assert "bed 'box': begins with what 1 runs know" in second.text
    assert bed_file.load(folders[1]).runs == 2

    before, after = (rows(daemon.path(), "/tick")["tan_phi_sigma"] for daemon in (first, second))
    assert after[0] < 0.8 * before[0]
    assert after[-1] < before[-1]
    assert verified(first.path()) and verified(second.path())
