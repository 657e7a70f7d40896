"""Runs of the daemon on one bed add up, and each of them can be verified."""

from __future__ import annotations

import shutil

from gritd.estimator.daemon import bed_file
from tests.scenarios.rig import driven, rows, service, verified

UPDATES = 20  # more of them in every run; how many more, the computer's load decides


def run(folder, skip):
    """One run of the daemon until its filter has been updated often; its process, ended. All are
    on one soil, and begin `skip` [s] into the same drive.
    """
    with service(folder, driven(40.0, 1, skip), bed={"name": "box"}) as (_, daemon):
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

    before, after = (sigma_after(daemon, 0) for daemon in (first, second))
    assert after < 0.8 * before
    before, after = (sigma_after(daemon, UPDATES) for daemon in (first, second))
    assert after < before
    assert verified(first.path()) and verified(second.path())


def sigma_after(daemon, updates):
    """σ of tan φ at the first tick with so many updates."""
    ticks = rows(daemon.path(), "/tick")
    return ticks["tan_phi_sigma"][ticks["updates"] >= updates][0]
