"""What `gritd replay` prints of the last estimate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.tools.commands.replay_report import report


@pytest.mark.parametrize(
    "flags, reported", [(Flag.NONE, False), (Flag.PRIOR | Flag.MISMATCH, True)]
)
def test_a_soil_that_is_the_prior_is_said_to_be(flags, reported):
    rows = np.ones(3, dtype=[(name, "<f8") for name in TICK_NAMES])
    rows["status"], rows["flags"] = Status.MISMATCH if reported else Status.TRACKING, flags
    rows["stamp"] = rows["evaluated"] = 1e9 * np.arange(3)
    lines = report(Path("run.mcap"), rows, "ticks").splitlines()
    said = "  soil       the prior: the filter's own estimate is not believed at the end"
    assert (said in lines) == reported
    assert any("MISMATCH" in line for line in lines) == reported


@pytest.mark.parametrize("consistency", [float("nan"), 1.25])
def test_a_run_without_innovations_shows_no_figure_of_them(consistency):
    rows = np.ones(3, dtype=[(name, "<f8") for name in TICK_NAMES])
    rows["consistency"] = consistency
    (line,) = (x for x in report(Path("a"), rows, "ticks").splitlines() if x.startswith("  σ "))
    said = line.split(maxsplit=1)[1]
    if np.isfinite(consistency):
        assert "variance 1.25 in the last 2 s" in said
    else:
        assert said == "no innovations yet"
