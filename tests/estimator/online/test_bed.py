"""Runs on one bed add up: against the direct solution of the same linear problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.config.settings import Repeatability, Uncertain
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import Estimate, Update, made
from gritd.estimator.online.bed import Array, Known, after_run, before_run, fingerprint, surprise
from tests.rig import SETTINGS

PRIOR = np.diag([0.09, 0.0036, 0.01])
NUISANCES = (0.04, 0.0025)  # variances


def measured(before: Estimate, rng: np.random.Generator) -> tuple[Estimate, Array, float, float]:
    """One scalar measurement: what a run is to the filter."""
    h, r, z = rng.normal(size=5), 0.01, float(rng.normal())
    innovation = (z - float(h @ np.array(before.x)),)
    update = Update(innovation, (tuple(h.tolist()),), ((r,),))
    return make_engine("plain").update(before, update), h, z, r


def estimate() -> Estimate:
    P = np.zeros((5, 5))
    P[:3, :3], P[3:, 3:] = PRIOR, np.diag(NUISANCES)
    return made((1.0, 0.577, -3.7, 0.0, 0.0), P)


@given(st.integers(0, 1000))
def test_without_scatter_the_posterior_is_handed_on_as_it_is(seed: int) -> None:
    rng, none = np.random.default_rng(seed), Repeatability()
    first, *_ = measured(estimate(), rng)
    known = after_run(Known((estimate(),), 0), (first,), none)
    assert known == Known((first,), 1) and before_run(known, none).bank == (first,)

    second, *_ = measured(first, rng)
    assert after_run(known, (second,), none).bank == (second,)


@given(st.integers(0, 1000))
def test_with_scatter_the_bed_is_what_the_direct_solution_says(seed: int) -> None:
    """One run of a bed with scatter: the bed's own posterior by conditioning of all at once."""
    rng, by = np.random.default_rng(seed), Repeatability(200.0, 0.03, 0.05)
    Q = np.zeros((5, 5))
    Q[:3, :3] = np.diag([0.2**2, 0.03**2, 0.05**2])
    known = Known((estimate(),), 5)  # the bed, as runs before left it

    (before,) = before_run(known, by).bank
    P = np.array(estimate().P)
    np.testing.assert_allclose(before.P, P + Q)
    after, h, z, r = measured(before, rng)
    bed = _alone(after_run(known, (after,), by))

    # bed and run's soil, each with the errors that they share, conditioned on the measurement
    full = np.block([[P, P], [P, P + Q]])
    row = np.concatenate([np.zeros(5), h])
    s = row @ full @ row + r
    gain = full @ row / s
    moved = gain[:5] * (z - h @ np.array(before.x))
    np.testing.assert_allclose(np.array(bed.x) - estimate().x, moved, atol=1e-9)
    np.testing.assert_allclose(bed.P, P - s * np.outer(gain[:5], gain[:5]), atol=1e-9)


def _alone(known: Known) -> Estimate:
    (member,) = known.bank
    return member


def test_a_run_of_the_soil_that_is_known_surprises_as_chi_square_does() -> None:
    """Moves of the estimate over what it was narrowed by: mean 1 a measured direction."""
    rng = np.random.default_rng(1)
    found = []
    for _ in range(2000):
        before = estimate()
        truth = rng.multivariate_normal(before.x[:3], PRIOR)
        h, r = rng.normal(size=3), 0.01
        z = h @ truth + np.sqrt(r) * rng.normal()
        gain = PRIOR @ h / (h @ PRIOR @ h + r)
        x, P = np.array(before.x), np.array(before.P)
        x[:3] += gain * (z - h @ x[:3])
        P[:3, :3] -= np.outer(gain, h @ PRIOR)
        after = made(tuple(x.tolist()), P)
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
