"""Noise of unknown colour: a misfit stands out of any, a trend that slow noise makes as easily does
not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gritd.estimator.effects import make
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.noise.estimate import restricted
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen import screening as module
from gritd.tools.diagnose.screen.open_colour import (
    OpenNoise,
    SuitableColours,
    _averaged,
    _left,
    _log_evidence,
    _term,
    _without_first,
)
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import begin
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import Plan, record
from tests.tools.diagnose.campaigns import plan

pytestmark = pytest.mark.long


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


def begun(drawn: Plan, *acting: str, axle: bool = True) -> EffectSearch:
    """The search after its first screen; axle: with the torque behind the drive measured too."""
    effects = [make(name, {"loss": 0.25}) for name in acting]
    signals = record(drawn, effects)
    if not axle:
        signals = [replace(s, analogue=_without(s.analogue, "axle_torque")) for s in signals]
    return begin(prepare_screening(fit_base(wheel_rig(signals, drawn.settings))))


def _without(channels: dict[str, Array], name: str) -> dict[str, Array]:
    return {n: values for n, values in channels.items() if n != name}


def test_a_trend_that_slow_noise_makes_is_no_alarm() -> None:
    """Two thirds of the variance keep 3 s of memory; with the colour assumed, half a dozen names
    stand out.
    """
    found = begun(plan(slow=0.3, slow_time=3.0, noise=2.0, seed=8)).first
    assert found.ratio > found.threshold
    assert found.open < TUNING.screen.sure
    assert not found.alarmed
    assert found.p > 0.01


def test_a_friction_stands_out_of_noise_of_any_colour() -> None:
    """Of slow noise too. Where the wheel starts little is known of single values, and slow noise
    may change there: so some of the evidence is lost, and most is left.
    """
    for slow in (0.0, 0.3):
        search = begun(plan(slow=slow, slow_time=1.0), "coulomb_friction", axle=False)
        found = search.first
        assert found.alarmed
        friction = found.best["coulomb_friction"]
        gain = OpenNoise(search.problem, search.base.fitted, [friction]).gain(0)
        assert gain > 20.0 * TUNING.screen.sure


def test_a_loss_of_the_drive_that_is_read_off_stands_out_too() -> None:
    """A steady loss could in part be slow noise of the two torques' difference: never all."""
    search = begun(plan(slow=0.3), "coulomb_friction")
    assert search.first.alarmed
    friction = search.first.best["coulomb_friction"]
    gain = OpenNoise(search.problem, search.base.fitted, [friction]).gain(0)
    assert gain > 20.0 * TUNING.screen.sure


def test_what_no_slow_noise_can_be_counts_wherever_it_ranks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the colour assumed others may stand out further than what slow noise cannot be."""
    search = begun(plan(), "coulomb_friction", axle=False)
    screening, model, found = search.screening, search.bare, search.first
    standing = [name for name in found.best if found.evidence[name] > 0.0]
    last = min(standing, key=lambda name: found.evidence[name])
    assert len(standing) > 1

    class _Open:
        def __init__(
            self, problem: Problem, fitted: Fitted, some: Sequence[Signature], jobs: int
        ) -> None:
            self._of = [s.of for s in some]

        def gain(self, number: int) -> float:
            return 100.0 if self._of[number] == last else 1.0

    monkeypatch.setattr(module, "OpenNoise", _Open)
    assert module._open(screening, model, found, 1) == 100.0


def test_products_of_very_quiet_recordings_keep_their_root() -> None:
    """Two columns that are one but for rounding, 10¹⁰ noises large: the evidence is a number, and
    that of columns of usual size is what it was.
    """
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((50, 4))
    columns[:, 1] = columns[:, 0] * (1.0 + 1e-17)
    for size in (1e10, 1e7, 10.0):
        scaled = size * columns
        scaled[:, -1] = columns[:, -1]
        assert np.isfinite(_log_evidence((scaled.T @ scaled)[None], np.ones(3))).all()

    inner, usual = np.eye(50) + scaled[:, :-1] @ scaled[:, :-1].T, scaled[:, -1]
    exact = -0.5 * (usual @ np.linalg.solve(inner, usual) + np.linalg.slogdet(inner)[1])
    assert _log_evidence((scaled.T @ scaled)[None], np.ones(3))[0] == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize("first", [0, 2, 4])
def test_columns_may_be_eliminated_one_after_the_other(first: int) -> None:
    rng = np.random.default_rng(7)
    columns, prior = rng.standard_normal((3, 40, 6)), rng.uniform(0.1, 10.0, 5)
    gram = columns.swapaxes(1, 2) @ columns
    rest, spread = _without_first(gram, prior[:first])
    parts = _log_evidence(rest, prior[first:]) - spread
    np.testing.assert_allclose(parts, _log_evidence(gram, prior), rtol=1e-9)


def test_a_channel_of_open_colour_has_the_evidence_of_all_columns_at_once() -> None:
    """Columns that do nothing in it, or nothing in the others, count as all others do."""
    rng = np.random.default_rng(11)
    here, elsewhere = rng.standard_normal((2, 3, 40, 6))
    here[..., [0, 2]] = 0.0
    elsewhere[..., [1, 4]] = 0.0
    one, other = (
        SuitableColours(c.swapaxes(1, 2) @ c, rng.standard_normal(3), rng.uniform(0.5, 2.0, 3), 40)
        for c in (here, elsewhere)
    )
    prior = np.ones((2, 5))
    prior[:, 3:] = [[1.0, 1.0], [4.0, 4.0]]

    found = _averaged(one, prior, [_term(other, 1, 1.0)])
    for number, size in enumerate(TUNING.screen.colour_sizes):
        for colour in range(3):
            terms = [_term(one, colour, size), _term(other, 1, 1.0)]
            gram, more = sum(t[0] for t in terms), sum(t[1] for t in terms)
            each = [_log_evidence(gram, p) + more for p in prior]
            wanted = np.logaddexp(*each) - np.log(2.0)
            assert found[colour, number] == pytest.approx(wanted, abs=1e-8)


@pytest.mark.parametrize("size", [1.0, 1e8])
def test_the_colours_that_suit_a_channel_are_those_of_all_columns_at_once(size: float) -> None:
    """Also where a signature is a column of the base, and large."""
    rng = np.random.default_rng(13)
    columns = rng.standard_normal((3, 60, 6))
    columns[..., 1] = 0.0  # does nothing here
    columns[..., 4] = size * columns[..., 0]
    gram, log_det = columns.swapaxes(1, 2) @ columns, rng.standard_normal(3)

    left, more, free = _left(gram, log_det, 60, 3)
    own = np.array([0, 2])  # one signature, and y
    likelihood, variance = restricted(left[:, own[:, None], own], more, free)
    every = np.array([0, 2, 3, 5])
    wanted = restricted(gram[:, every[:, None], every], log_det, 60)
    np.testing.assert_allclose(likelihood, wanted[0], rtol=1e-6)
    np.testing.assert_allclose(variance, wanted[1], rtol=1e-6)

    own = np.array([0, 1, 2])
    assert np.isfinite(restricted(left[:, own[:, None], own], more, free)).all()
