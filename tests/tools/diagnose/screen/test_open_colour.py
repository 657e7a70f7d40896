"""Noise of unknown colour: a misfit stands out of any, a trend that slow noise makes as easily does
not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gritd.estimator.effects import make
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.open_colour import OpenNoise, _log_evidence
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import Search, begin
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import Plan, record
from tests.tools.diagnose.campaigns import plan


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with np.errstate(all="ignore"):
        yield


def test_the_evidence_is_that_of_a_multivariate_normal() -> None:
    rng = np.random.default_rng(3)
    columns, values, precision = (
        rng.normal(size=(30, 4)),
        rng.normal(size=30),
        np.array([1.0, 1.0, 0.1, 4.0]),
    )
    every = np.column_stack((columns, values))
    covariance = np.eye(30) + columns @ np.diag(1.0 / precision) @ columns.T
    wanted = multivariate_normal(np.zeros(30), covariance).logpdf(values) + 15.0 * np.log(
        2.0 * np.pi
    )
    assert _log_evidence(every.T @ every, precision) == pytest.approx(wanted)


def begun(drawn: Plan, *acting: str) -> Search:
    """The search after its first screen."""
    effects = [make(name, {"loss": 0.25}) for name in acting]
    rng = np.random.default_rng(0)
    base = fit_base(WheelRig(record(drawn, effects), drawn.settings), rng)
    return begin(prepare_screening(base, rng))


def test_a_trend_that_slow_noise_makes_is_no_alarm() -> None:
    """Two thirds of the variance keep 3 s of memory; with the colour assumed, half a dozen names
    stand out.
    """
    found = begun(plan(slow=0.3, slow_time=3.0, noise=2.0, seed=13)).first
    assert found.largest[1] > found.threshold
    assert found.open < TUNING.screen.sure
    assert not found.alarmed
    assert found.p > 0.01


def test_a_friction_stands_out_of_noise_of_any_colour() -> None:
    """Of slow noise too, and its evidence is hardly less than with the colour assumed."""
    for slow in (0.0, 0.3):
        search = begun(plan(slow=slow, slow_time=1.0), "coulomb_friction")
        found = search.first
        assert found.alarmed
        friction = found.best["coulomb_friction"].signature
        gain = OpenNoise(search.problem, search.base.fitted, [friction]).gain(0)
        assert gain > max(0.5 * found.evidence["coulomb_friction"], TUNING.screen.sure)
