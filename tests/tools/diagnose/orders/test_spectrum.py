"""Spectra of uneven readings: their sums, the level of the noise, the chance of a line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.tools.diagnose.orders.lines import find_lines
from gritd.tools.diagnose.orders.spectrum import (
    Spectrum,
    fourier_sums,
    log_chance,
    places_of,
    spectrum,
)
from gritd.tools.diagnose.orders.stretches import Samples
from gritd.tools.diagnose.orders.wave import amplitude_of
from gritd.tools.diagnose.tuning import replaced
from tests.tools.diagnose.orders.made import campaign, readings, red

pytestmark = pytest.mark.long


@given(seed=st.integers(0, 1000), spacing=st.floats(0.01, 0.5), count=st.integers(1, 900))
@settings(max_examples=30, deadline=None)
def test_sums_at_uneven_places_are_the_plain_sums(seed: int, spacing: float, count: int) -> None:
    rng = np.random.default_rng(seed)
    place, values = np.sort(rng.uniform(-3.0, 9.0, 300)), rng.standard_normal(300)
    found = fourier_sums(place, values, spacing, count)
    phase = 2.0 * np.pi * spacing * np.outer(np.arange(count), place)
    np.testing.assert_allclose(found, np.exp(-1j * phase) @ values, atol=1e-4)


@given(
    seed=st.integers(0, 10_000),
    order=st.floats(12.0, 390.0),
    size=st.floats(0.0, 5.0),
    phase=st.floats(0.0, 6.28),
)
@settings(max_examples=40, deadline=None)
def test_amplitude_and_phase_of_any_order_come_back_within_sigma(
    seed: int, order: float, size: float, phase: float
) -> None:
    """Up to the fastest ripple that is no alias, in unit white noise: its level is 1."""
    rng = np.random.default_rng(seed)
    cos, sin = size * np.cos(phase), size * np.sin(phase)
    made = readings(rng, (cos, sin, order))
    made = made.with_values(made.detrended(made.values))
    found = amplitude_of(made, "angle", order, 1.0)
    assert found.sigma == pytest.approx(np.sqrt(2.0 / made.values.size), rel=0.1)
    assert abs(found.cos - cos) < 4.5 * found.sigma
    assert abs(found.sin - sin) < 4.5 * found.sigma


def test_chances_of_many_parts_are_those_of_each_place_alone() -> None:
    rng = np.random.default_rng(3)
    parts = [
        Spectrum(rng.exponential(size=100), rng.uniform(0.5, 2.0, 100), rng.uniform(2.0, 20.0, 100))
        for _ in range(7)
    ]
    parts[0].level[:40] = np.inf  # nothing is known of it there
    alone = [log_chance([p.at(slice(i, i + 1)) for p in parts])[0] for i in range(100)]
    np.testing.assert_allclose(log_chance(parts), alone, rtol=1e-12)


def test_sigma_of_an_amplitude_is_its_scatter() -> None:
    off = []
    for seed in range(60):
        made = readings(np.random.default_rng(seed), (0.3, -0.2, 55.0))
        made = made.with_values(made.detrended(made.values))
        found = amplitude_of(made, "angle", 55.0, 1.0)
        off += [(found.cos - 0.3) / found.sigma, (found.sin + 0.2) / found.sigma]
    assert 0.8 < float(np.std(off)) < 1.2


@pytest.mark.parametrize("slow", [0.0, 1.0])
def test_chance_at_one_order_is_uniform_in_noise(slow: float) -> None:
    """White and red noise, the chances of two runs together at three orders each time."""
    found = []
    for seed in range(120):
        rng = np.random.default_rng(seed)
        parts = [red(readings(rng), rng, slow) for _ in range(2)]
        parts = [part.with_values(part.detrended(part.values)) for part in parts]
        places = places_of(parts, "angle")
        chance = log_chance([spectrum(part, "angle", places) for part in parts])
        found += [float(np.exp(chance[round(o / places.spacing)])) for o in (25.0, 90.0, 300.0)]
    for level in (0.05, 0.2, 0.5, 0.8):
        share = float(np.mean(np.array(found) < level))
        assert abs(share - level) < 4.0 * np.sqrt(level * (1.0 - level) / len(found))


@pytest.mark.parametrize("slow", [0.0, 3.0])
@pytest.mark.parametrize("drift", [0.0, 100.0])
def test_neither_noise_nor_drift_makes_a_line(slow: float, drift: float) -> None:
    """The chance counts all that was tried: of 60 campaigns two have one below 1 in 30."""
    least = []
    for seed in range(60):
        rng = np.random.default_rng((seed, 7))
        runs = [red(readings(rng, drift=drift), rng, slow) for _ in range(1 + seed % 3)]
        assert find_lines(campaign(runs)) == ()
        with replaced("orders", level=1.0, most_lines=1):
            least += [line.p for line in find_lines(campaign(runs))]
    assert np.sum(np.array(least) < 1.0 / 30.0) <= 6


def test_stretches_too_short_for_a_spectrum_tell_nothing() -> None:
    """Two readings a second, and stretches of one: no ripple has a cycle in one and is no alias."""
    time = np.concatenate([at + np.arange(0.0, 1.0, 0.5) for at in (0.0, 8.0, 16.0)])
    part = Samples(time, 0.05 * time, np.sin(time), np.repeat(np.arange(3), 2))
    places = places_of([part], "time")
    assert np.isinf(spectrum(part, "time", places).level).all()
