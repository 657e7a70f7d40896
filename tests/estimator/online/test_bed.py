"""Runs on one bed add up: against the direct solution of the same linear problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.config.settings import Repeatability, Uncertain
from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.online.bed import Array, Known, after_run, before_run, fingerprint, surprise
from tests.rig import SETTINGS

PRIOR = np.diag([0.09, 0.0036, 0.01])
NUISANCES = (0.04, 0.0025)  # variances


def measured(before: Estimate, rng: np.random.Generator) -> tuple[Estimate, Array, float, float]:
    """One scalar measurement with calibration errors considered: what a run is to the filter."""
    h, r = rng.normal(size=5), 0.01
    z = rng.normal()
    P, X, V = np.array(before.P), np.array(before.cross), np.diag(NUISANCES)
    joint = np.block([[P, X], [X.T, V]])
    s = h @ joint @ h + r
    gain = (joint @ h / s)[:3]
    x = np.array(before.x) + gain * (z - h[:3] @ np.array(before.x))
    column = joint[:3] @ h
    P_after = P - np.outer(gain, column) - np.outer(column, gain) + s * np.outer(gain, gain)
    X_after = X - np.outer(gain, joint[3:] @ h)
    rows = lambda matrix: tuple(map(tuple, matrix.tolist()))  # noqa: E731
    return Estimate(tuple(x.tolist()), rows(P_after), rows(X_after)), h, z, r


def estimate() -> Estimate:
    rows = tuple(map(tuple, PRIOR.tolist()))
    return Estimate((1.0, 0.577, -3.7), rows, ((0.0, 0.0),) * 3)


@given(st.integers(0, 1000))
def test_without_scatter_the_posterior_is_handed_on_as_it_is(seed: int) -> None:
    rng, none = np.random.default_rng(seed), Repeatability()
    first, *_ = measured(estimate(), rng)
    known = after_run(Known(estimate(), 0), first, none, NUISANCES)
    assert known == Known(first, 1) and before_run(known, none) == first

    second, *_ = measured(first, rng)
    after = after_run(known, second, none, NUISANCES)
    for ours, theirs in zip(after.estimate, second, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-9)


@given(st.integers(0, 1000))
def test_with_scatter_the_bed_is_what_the_direct_solution_says(seed: int) -> None:
    """One run of a bed with scatter: the bed's own posterior by conditioning of all at once."""
    rng, by = np.random.default_rng(seed), Repeatability(200.0, 0.03, 0.05)
    Q = np.diag([0.2**2, 0.03**2, 0.05**2])
    known = Known(estimate(), 5)  # the bed, as runs before left it

    before = before_run(known, by)
    np.testing.assert_allclose(before.P, PRIOR + Q)
    after, h, z, r = measured(before, rng)
    bed = after_run(known, after, by, NUISANCES).estimate

    # the joint of bed, run's soil and ν, conditioned on the one measurement as Schmidt does: the
    # gain of ν is zero, those of bed and soil are optimal
    P, V = PRIOR, np.diag(NUISANCES)
    full = np.block([
        [P, P, np.zeros((3, 2))],
        [P, P + Q, np.zeros((3, 2))],
        [np.zeros((2, 6)), V],
    ])  # fmt: skip
    row = np.concatenate([np.zeros(3), h])
    s = row @ full @ row + r
    gain = full @ row / s
    x = np.array([*known.estimate.x, *before.x])
    moved = gain[:3] * (z - h[:3] @ x[3:])
    np.testing.assert_allclose(np.array(bed.x) - known.estimate.x, moved, atol=1e-9)
    expected = full[:3, :3] - s * np.outer(gain[:3], gain[:3])
    np.testing.assert_allclose(bed.P, expected, atol=1e-9)


def test_a_run_of_the_soil_that_is_known_surprises_as_chi_square_does() -> None:
    """Moves of the estimate over what it was narrowed by: mean 1 a measured direction."""
    rng = np.random.default_rng(1)
    found = []
    for _ in range(2000):
        before = estimate()
        truth = rng.multivariate_normal(before.x, PRIOR)
        h, r = rng.normal(size=3), 0.01
        z = h @ truth + np.sqrt(r) * rng.normal()
        gain = PRIOR @ h / (h @ PRIOR @ h + r)
        x = np.array(before.x) + gain * (z - h @ np.array(before.x))
        P = PRIOR - np.outer(gain, h @ PRIOR)
        after = Estimate(tuple(x.tolist()), tuple(map(tuple, P.tolist())), before.cross)
        found.append(surprise(before, after))
    assert np.mean(found) == pytest.approx(1.0, abs=0.1)


def test_another_calibration_prior_or_effect_is_another_rig_and_another_load_is_not() -> None:
    settings = SETTINGS
    nominal = Uncertain(99.0, settings.load.nominal.sigma)
    heavier = replace(settings, load=replace(settings.load, nominal=nominal))
    assert fingerprint(heavier) == fingerprint(settings)
    soil = replace(settings.soil, cohesion=Uncertain(500.0, 100.0))
    drive = replace(settings.drive, torque_constant=Uncertain(2.2, 0.1))
    for other in (replace(settings, soil=soil), replace(settings, drive=drive)):
        assert fingerprint(other) != fingerprint(settings)
