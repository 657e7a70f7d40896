"""The soil changes under the wheel: whether σ stays honest. The testbed obeys the original
equations, with calibrations off by their own σ; a case is one run through the windows and the
filter.
"""

from __future__ import annotations

import numpy as np
import pytest

from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.status import UPDATED, Flag, Status
from gritd.tools.commands.status import summary
from gritd.tools.dev import soil_changes as changes
from tests.scenarios.recorded import log_lines, verified
from tests.scenarios.rig import WIRES, driven, service

CHANGES = "step, ramp or patch of the soil"
DEPTH = "a filter out of its depth"
CASES = "windows and filter, testbed simulated"
BEYOND = 0.02  # of the time, without a flag
LATE = 0.1  # of the cases: an honest σ leaves 5 % outside 2σ at any time


@pytest.mark.parametrize("cases", [12, pytest.param(200, marks=pytest.mark.slow)])
def test_the_soil_changes(cases, figure):
    settings = changes.packaged_rig()
    seeds = range(100_000, 100_000 + cases)
    found = [verdict for _, verdict in changes.verdicts(settings, seeds, "original", 250.0)]
    driven = sum(verdict.driven for verdict in found)
    silent = sum(verdict.beyond for verdict in found) / driven
    late = np.mean([verdict.back > changes.BACK for verdict in found])
    level = f"{CASES}, {cases} cases"
    figure(CHANGES, level, "time beyond 3σ without a flag", 1e2 * silent, "%", 1e2 * BEYOND)
    figure(CHANGES, level, "cases not back within 2σ in 15 s", 1e2 * late, "%", 1e2 * LATE)


@pytest.mark.parametrize("runs", [3, pytest.param(120, marks=pytest.mark.slow)])
def test_the_soil_stays_the_same(runs, figure):
    settings = changes.packaged_rig()
    seeds = range(100_000, 100_000 + runs)
    tracks = [track for _, track in changes.unchanged(settings, seeds, "original", 250.0)]
    hours = runs * changes.UNCHANGED / 3600.0
    flags = sum(changes.begun(track) for track in tracks) / hours
    level = f"{CASES}, {hours:g} h"
    figure(CHANGES, level, "false flags an hour in an unchanged soil", flags, "", 1)


@pytest.mark.parametrize("loss", [0.4, 0.8])
def test_a_loss_that_nobody_stated(seed, loss, figure):
    """A drive that loses more torque than any soil explains [N·m]: the prior is reported."""
    settings = changes.packaged_rig()
    case = changes.case(settings, "none", seed)
    tracker = Tracker(case.settings)
    state, accounts = tracker.start(), []
    for snapshot in case.snapshots[:1200]:
        current = snapshot.current.value + loss / settings.drive.torque_constant.value
        lossy = snapshot._replace(current=snapshot.current._replace(value=current))
        state, account = tracker.step(state, lossy)
        accounts.append(account)

    updated = [a for a in accounts[100:] if a.status in UPDATED]
    believed = sum(a.status == Status.TRACKING for a in updated)
    figure(DEPTH, CASES, "updates still believed after 10 s", 1e2 * believed / len(updated), "%")
    assert any(a.flags & Flag.MISMATCH for a in accounts)
    for account in updated:
        assert (account.status == Status.TRACKING) != bool(account.flags & Flag.PRIOR)
        if account.flags & Flag.PRIOR:
            assert account.estimate == tracker.prior


def test_a_wrong_torque_constant_is_told_everywhere(tmp_path, figure):
    """Twice the torque: the journal, the status and the recording say that c and tan φ are the
    prior, and why.
    """
    wrong = {"torque_constant": {"value": "4.0 N*m/A", "sigma": "0.01 N*m/A"}}
    with service(tmp_path, driven(60.0, 1, skip=1.0), drive=wrong) as (_, daemon):
        daemon.heard("the filter's estimate is not believed, c and tan φ are the prior: ")
        report = daemon.wait_status(lambda report: "PRIOR" in report["flags"])
        daemon.stop()

    assert report["tick"]["cohesion"] == pytest.approx(changes.packaged_rig().soil.cohesion.value)
    assert any("(the prior: the filter's estimate is not believed)" in x for x in summary(report))
    said = [line for line in log_lines(daemon.path()) if "is not believed" in line]
    assert said and len(said) == len(daemon.lines("is not believed"))
    assert verified(daemon.path())
    figure(DEPTH, WIRES, "lines until it was reported", len(said), "")
