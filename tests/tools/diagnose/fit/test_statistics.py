"""The statistics that everything rests on: noise colour, whitening, evidence, held-out density."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lfilter
from scipy.special import logsumexp
from scipy.stats import norm

from gritd.estimator.compiled import whitening
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.result import plain
from gritd.tools.diagnose.fit.columns import whole
from gritd.tools.diagnose.fit.evidence import log_bayes, log_sum, strength_sizes
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.noise.colour import (
    Colour,
    Noise,
    _innovations,
    _recursion,
    covariance,
    products_of_innovations,
    unit_whitener,
)
from gritd.tools.diagnose.noise.estimate import restricted
from gritd.tools.diagnose.noise.saturated import saturated_mean
from gritd.tools.diagnose.tuning import TUNING, replaced
from gritd.tools.proof.ours.coloured import _filtered, coloured

GAPS = np.where(np.arange(600) % 200 == 0, np.inf, 0.1)


def whiten_unit(
    columns: Array, gaps: Array, colours: Sequence[Colour], beside: Array | None = None
) -> tuple[Array, Array]:
    """All innovations (g, n, m) of columns (n, m) at once, and log det of each covariance."""
    recursion = _recursion(gaps, colours, beside)
    pieces = list(_innovations(columns, recursion, len(columns)))
    return np.concatenate(pieces, axis=1), 2.0 * np.log(recursion[2]).sum(axis=0)


def test_whitening_leaves_independent_unit_noise() -> None:
    """With a run boundary and a gap inside a run."""
    gaps = GAPS.copy()
    gaps[300] = 1.5
    colour = Colour(1.0, 2.0, 0.5, 0.3)
    noise = coloured(gaps, 400, colour, np.random.default_rng(0))
    white = whiten_unit(noise, gaps, [colour])[0][0]
    assert np.var(white) == pytest.approx(1.0, abs=0.02)
    lagged = [np.mean(white[k:] * white[:-k]) for k in (1, 2, 5, 20)]
    np.testing.assert_allclose(lagged, 0.0, atol=0.02)


def test_whitening_is_the_inverse_root_of_the_covariance() -> None:
    colour = Colour(1.0, 2.0, 0.5, 0.3)
    gaps = GAPS[:50]
    root = whiten_unit(np.eye(50), gaps, [colour])[0][0]
    time = np.cumsum(np.where(np.isfinite(gaps), gaps, 0.0))
    apart = np.abs(time[:, None] - time)
    covariance = 0.5 * _of_means(apart, 0.1, 2.0) + 0.3 * np.exp(-apart / 0.15) + 0.2 * np.eye(50)
    np.testing.assert_allclose(root @ covariance @ root.T, np.eye(50), atol=1e-5)


@pytest.mark.parametrize("time", [0.5, 2.0, 10.0])
def test_values_that_are_nearer_than_the_usual_interval_are_whitened_too(time: float) -> None:
    """A log whose readings came in bursts: no innovation is without noise."""
    gaps = np.where(np.arange(90) % 3 == 2, 0.02, 0.5)
    white, log_det = whiten_unit(np.eye(90), gaps, [Colour(1.0, time, 0.99)])
    assert np.isfinite(white).all() and np.isfinite(log_det).all()
    assert np.abs(white).max() < 100.0


def _of_means(apart: Array, step: float, time: float) -> Array:
    """Correlation (n, n) of means over intervals of an Ornstein-Uhlenbeck process: quadrature."""
    places = (np.arange(400) + 0.5) / 400 * step
    offsets, counts = np.unique(np.round(np.subtract.outer(places, places), 9), return_counts=True)
    kept = np.exp(-np.abs(apart[..., None] + offsets) / time) @ counts / counts.sum()
    return np.asarray(kept / kept[0, 0])


@pytest.mark.parametrize(
    "colour", [Colour(1.0, 0.5, 0.0), Colour(1.0, 10.0, 0.15, 0.34), Colour(1.0, 4.0, 0.99, 0.005)]
)
def test_the_banded_whitener_holds_all_that_is_not_negligible(colour: Colour) -> None:
    gaps = GAPS.copy()
    gaps[200], gaps[300] = 1.5, np.inf
    whole = whiten_unit(np.eye(gaps.size), gaps, [colour])[0][0]
    whole[np.abs(whole) < TUNING.numerics.negligible] = 0.0
    np.testing.assert_array_equal(unit_whitener(gaps, colour).toarray(), whole)


def _noise_of_three_runs(uncertain: Array, rougher: Array | float = 1.0) -> Noise:
    """Of one channel, slow and fast; uncertain (600,) of single values."""
    stack = SimpleNamespace(
        parts=[("pull", 0), ("pull", 1), ("pull", 2)],
        rig=SimpleNamespace(channels=("pull",)),
        of=lambda channel: np.ones(GAPS.size, bool),
        run=np.repeat(np.arange(3), 200),
        channel=np.zeros(GAPS.size, int),
        gaps=GAPS,
        size=GAPS.size,
    )
    colour = Colour(2.0, 0.5, 0.6, 0.3)
    nothing = np.zeros((GAPS.size, 0))
    return Noise(cast(Any, stack), (colour,), uncertain, nothing, rougher)


def test_what_is_uncertain_of_single_values_is_white_noise_beside_slow_noise() -> None:
    """A value of which little is known leaves the slow noise of its neighbours as large as it
    is: whitened and drawn alike.
    """
    uncertain, rougher = np.zeros(GAPS.size), np.ones(GAPS.size)
    uncertain[300:304], rougher[450:500] = 14.0, 3.0
    noise = _noise_of_three_runs(uncertain, rougher)
    time = np.where(np.isfinite(GAPS), GAPS, 1e6).cumsum()
    of_channel = covariance(noise.colours[0], time, GAPS) * np.outer(rougher, rougher)
    expected = of_channel + np.diag(uncertain**2)

    root = noise.whitener.toarray()
    np.testing.assert_allclose(root @ expected @ root.T, np.eye(GAPS.size), atol=1e-3)


def test_a_stretch_touches_the_innovations_in_which_it_weighs_and_none_of_another_run() -> None:
    noise = _noise_of_three_runs(np.zeros(GAPS.size))

    touched = noise.touched(210, 240)
    weighs = np.flatnonzero(np.any(noise.whitener[:, 210:240].toarray() != 0.0, axis=1))
    assert (touched.start, touched.stop) == (weighs[0], weighs[-1] + 1)
    assert 240 < touched.stop < 400
    assert noise.touched(390, 400).stop == 400


def test_products_of_innovations_are_the_same_however_many_are_in_memory() -> None:
    columns = np.random.default_rng(3).standard_normal((GAPS.size, 4))
    tried = [Colour(1.0, 2.0, 0.5, 0.3), Colour(1.0, 0.5, 0.0)]
    whitened, log_det = whiten_unit(columns, GAPS, tried)
    with replaced("numerics", whitened_at_once=8 * 17):
        gram, same = products_of_innovations(columns, GAPS, tried)
    np.testing.assert_allclose(gram, whitened.transpose(0, 2, 1) @ whitened, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(same, log_det)


@pytest.mark.skipif(not whitening.BUILT, reason="gritd was installed without a compiler")
def test_compiled_innovations_have_the_bits_of_the_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = np.asfortranarray(np.random.default_rng(4).standard_normal((GAPS.size, 7)))
    tried = [Colour(1.0, 2.0, 0.5, 0.3), Colour(1.0, 0.5, 0.0), Colour(1.0, 4.0, 0.95, 0.04)]
    compiled, _ = whiten_unit(columns, GAPS, tried)
    monkeypatch.setattr(whitening, "BUILT", False)
    by_loop, _ = whiten_unit(columns, GAPS, tried)
    np.testing.assert_array_equal(compiled, by_loop)


@pytest.mark.skipif(not whitening.BUILT, reason="gritd was installed without a compiler")
def test_arrays_that_do_not_fit_are_refused() -> None:
    some, state = np.zeros((4, 3)), np.zeros((2, 3))
    kept, scale, out = np.zeros((2, 4, 2)), np.ones((4, 2)), np.zeros((2, 4, 3))
    with pytest.raises(ValueError, match="do not fit"):
        whitening.fill(some, kept, kept, scale, state, state.copy(), out, 4, 2, 3, 1, 4)


def test_a_relaxing_process_remembers_as_a_filter_of_first_order_does() -> None:
    kicks = np.random.default_rng(6).standard_normal((300, 4))
    np.testing.assert_allclose(_filtered(kicks, 0.97), lfilter([1.0], [1.0, -0.97], kicks, axis=0))


def test_a_sum_of_exponentials_is_that_of_scipy() -> None:
    terms = np.array([[1e3, -np.inf, 0.0], [1e3 + 1.0, -np.inf, -800.0]])
    np.testing.assert_allclose(log_sum(terms), logsumexp(terms, axis=0))


def test_the_size_of_the_noise_is_found_beside_a_misfit() -> None:
    """Restricted likelihood: a large misfit inside the saturated mean does not count as noise."""
    rng = np.random.default_rng(2)
    columns = np.column_stack([np.cos(np.pi * k * np.arange(600) / 600) for k in range(30)])
    noise = coloured(GAPS, 1, Colour(0.2, 0.5, 0.5), rng)[:, 0]
    misfit = columns @ rng.normal(0.0, 3.0, 30)
    whitened, log_det = whiten_unit(
        np.column_stack((columns, noise + misfit)), GAPS, [Colour(1.0, 0.5, 0.5)]
    )
    _, variance = restricted(whitened.transpose(0, 2, 1) @ whitened, log_det, 600)
    assert np.sqrt(variance[0]) == pytest.approx(0.2, rel=0.15)


def test_rounding_is_no_direction_of_the_saturated_mean() -> None:
    """What an effect does not change comes out of a solver as 1e-12: scaled to unit size it would
    take noise away.
    """
    rng = np.random.default_rng(7)
    residual, effects, sure = (
        rng.standard_normal(400),
        rng.standard_normal((400, 3)),
        rng.standard_normal((400, 2)),
    )
    held = effects @ [1.0, 2.0, 3.0]
    cells = np.repeat([0, 1, -1, -1], 100)
    alone = saturated_mean(residual, effects, sure, cells)
    beside = saturated_mean(
        residual, np.column_stack((1e-9 * rng.standard_normal((400, 50)), effects)), sure, cells
    )
    assert alone.shape == beside.shape == (400, 7)
    np.testing.assert_allclose(beside @ beside.T, alone @ alone.T, atol=1e-9)
    np.testing.assert_allclose(alone @ (alone.T @ held), held, atol=1e-9)


def test_log_bayes_is_the_integral() -> None:
    """One strength: the closed form against quadrature of likelihood times prior."""
    a, b = np.array([[2.0]]), np.array([3.0])

    def integrand(x: float, scale: float) -> float:
        return float(np.exp(b[0] * x - 0.5 * a[0, 0] * x * x) * norm.pdf(x, 0.0, scale))

    two_sided = np.mean(
        [quad(integrand, -40, 40, args=(s,), points=[0.0, 1.5])[0] for s in strength_sizes()]
    )
    one_sided = np.mean(
        [2.0 * quad(integrand, 0, 40, args=(s,), points=[0.1, 1.5])[0] for s in strength_sizes()]
    )
    assert log_bayes(a, b, (0,)) == pytest.approx(np.log(two_sided), rel=1e-6)
    assert log_bayes(a, b, (1,)) == pytest.approx(np.log(one_sided), rel=1e-6)


def test_strain_against_the_prior_is_evidence() -> None:
    """An effect that a constant of the base model absorbs: the residual is noise, the strained
    prior names it.
    """
    rng = np.random.default_rng(3)
    direction = rng.standard_normal(400)
    direction /= np.linalg.norm(direction)
    jacobian = 100.0 * direction[:, None]  # the constant moves the data by 100 σ per prior σ
    residual = rng.standard_normal(400) * 0.01
    strained = Projection(whole(jacobian), residual, np.array([5.0]))  # pulled five prior σ off
    relaxed = Projection(whole(jacobian), residual, np.array([0.0]))
    column = 300.0 * direction[:, None]
    assert log_bayes(*strained.project(column), (0,)) > 5.0
    assert log_bayes(*relaxed.project(column), (0,)) < 0.0


def test_json_has_no_nan() -> None:
    assert plain({"a": [float("nan"), np.float64(1.5), (np.int64(2), True, None, "x")]}) == {
        "a": [None, 1.5, [2, True, None, "x"]]
    }
