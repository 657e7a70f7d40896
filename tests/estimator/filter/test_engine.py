"""The two engines: each is loaded only where it is configured, and both compute the same."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import STATES, Update, made, rows

LOADED = """
import sys
import gritd.tools.service.serve
from gritd.estimator.filter.engine import make_engine
make_engine({name!r})
print(*(name for name in ("filterpy", "scipy", "matplotlib") if name in sys.modules))
"""


@pytest.mark.parametrize("name, loaded", [("plain", []), ("filterpy", ["filterpy", "scipy"])])
def test_a_daemon_loads_filterpy_and_scipy_only_for_the_engine_that_needs_them(name, loaded):
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(name=name)], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == loaded


def test_an_unknown_engine_is_named_with_those_there_are():
    with pytest.raises(ValueError, match="no engine 'plane'; expected one of filterpy, plain"):
        make_engine("plane")
    assert all(make_engine(name) for name in ENGINES)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("beside", [0, 1, 8, 30])
def test_both_engines_give_one_update_to_1e_9_of_sigma(components, beside):
    rng = np.random.default_rng((components, beside))
    for _ in range(100):
        estimate, update = drawn(rng, components, beside)
        plain, filterpy = (
            make_engine(name).update(estimate, update) for name in ("plain", "filterpy")
        )
        sigma = np.sqrt(np.diag(estimate.P))
        near = {"rtol": 1e-8, "atol": 1e-9}
        np.testing.assert_allclose(plain.x / sigma, filterpy.x / sigma, **near)
        scale = np.outer(sigma, sigma)
        np.testing.assert_allclose(plain.P / scale, filterpy.P / scale, **near)
        assert plain.log_evidence == pytest.approx(filterpy.log_evidence, rel=1e-8)


def test_the_evidence_is_the_density_of_what_was_measured():
    rng = np.random.default_rng(3)
    estimate, update = drawn(rng, 2, 8)
    H, R = np.array(update.H), np.array(update.R)
    S = H @ np.array(estimate.P) @ H.T + R
    density = multivariate_normal(np.zeros(2), S).logpdf(np.array(update.innovation))
    found = make_engine("plain").update(estimate, update).log_evidence
    assert found - np.log(2.0 * np.pi) == pytest.approx(density)


def drawn(rng, components, beside):
    """An estimate of the soil and so many errors beside it, and a measurement."""
    size = STATES + beside
    root = rng.normal(size=(size, size)) * np.exp(rng.normal(size=(size, 1)))
    estimate = made(tuple(rng.normal(size=size).tolist()), root @ root.T + 1e-6 * np.eye(size))
    noise = rng.normal(size=(components, components))
    update = Update(
        tuple(rng.normal(size=components).tolist()),
        rows(rng.normal(size=(components, size))),
        rows(noise @ noise.T + np.eye(components)),
    )
    return estimate, update
