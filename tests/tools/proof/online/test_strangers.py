"""Benches that the filter has not seen, as a stranger's tables: right, or not believed with a
reason. The plant is that of `gritd prove`, whose code is its own.
"""

from __future__ import annotations

from math import isfinite

import numpy as np
import pytest

from gritd.tools.proof.online.draw import CHANGES, LEFT_OUT, STRATA, drawn
from gritd.tools.proof.online.drive import driven, share
from gritd.tools.proof.online.exact import sigma_of_c
from gritd.tools.proof.online.judge import handed_over, scored

WHOLE = [name for name in STRATA if name not in (*LEFT_OUT, *CHANGES)]


def score(tmp_path, stratum, seed):
    bench = drawn(stratum, seed)
    return scored(bench, tmp_path / "bench", handed_over(bench, tmp_path / "bench"))


@pytest.mark.parametrize("stratum", WHOLE)
def test_what_is_believed_of_a_strange_bench_is_right(tmp_path, stratum):
    found = score(tmp_path, stratum, 11)
    assert found.believed, found.reason
    assert max(abs(found.c), abs(found.tan_phi)) < 3.0
    assert found.changes == 0 and isfinite(found.first)


@pytest.mark.parametrize("stratum", ["friction", "wall"])
def test_a_bench_whose_physics_is_not_stated_is_not_believed_and_told_why(tmp_path, stratum):
    found = score(tmp_path, stratum, 11)
    assert not found.believed and "diagnose" in found.reason


@pytest.mark.long
def test_a_step_of_the_soil_is_said_or_within_sigma(tmp_path):
    assert score(tmp_path, "step", 11).silent < 0.1


@pytest.mark.parametrize("stratum", STRATA)
def test_a_bench_is_the_same_from_the_same_seed(stratum):
    assert drawn(stratum, 3) == drawn(stratum, 3) != drawn(stratum, 4)


def test_a_patch_is_there_between_its_ends():
    course = drawn("patch", 5).runs[0].course
    time = np.array([course.begin - 1.0, course.begin + 1.0, course.end + 1.0])
    assert share(course, time).tolist() == [0.0, 1.0, 0.0]


def test_more_noise_is_a_wider_bound():
    bench = drawn("stated", 6)
    tables = driven(bench)
    noise = bench.noise._replace(force=2.0 * bench.noise.force, torque=2.0 * bench.noise.torque)
    louder = type(bench)(**{**vars(bench), "noise": noise})
    assert 1.2 < sigma_of_c(louder, tables) / sigma_of_c(bench, tables) < 2.1
