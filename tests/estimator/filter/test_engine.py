"""The two engines: each is loaded only where it is configured, and both compute the same."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import STATES, Estimate, Update

LOADED = """
import sys
import gritd.tools.service.serve
from gritd.estimator.filter.engine import make_engine
make_engine({name!r}, (0.01,))
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
        make_engine("plane", ())
    assert all(make_engine(name, ()) for name in ENGINES)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("consider_k", [False, True])
@pytest.mark.parametrize("nuisances", [0, 1, 8])
def test_both_engines_give_one_update_to_1e_9_of_sigma(components, consider_k, nuisances):
    rng = np.random.default_rng((components, consider_k, nuisances))
    for _ in range(200):
        estimate, variances, update = drawn(rng, components, nuisances)
        plain, filterpy = (
            make_engine(name, variances).update(estimate, update, consider_k)
            for name in ("plain", "filterpy")
        )
        sigma = np.sqrt(np.diag(estimate.P))
        scale = np.append(sigma, np.sqrt(variances))
        joint = np.outer(sigma, scale)
        near = {"rtol": 1e-9, "atol": 1e-9}
        np.testing.assert_allclose(plain.x / sigma, filterpy.x / sigma, **near)
        left, right = (
            np.hstack((e.P, np.reshape(e.cross, (STATES, -1)))) for e in (plain, filterpy)
        )
        np.testing.assert_allclose(left / joint, right / joint, **near)


def drawn(rng, components, nuisances):
    """An estimate with the nuisances' variances, and a measurement of some components."""
    size = STATES + nuisances
    root = rng.normal(size=(size, size)) * np.exp(rng.normal(size=(size, 1)))
    joint = root @ root.T
    # nuisances are independent of one another, so their part is a diagonal that holds the rest
    variances = np.diag(joint)[STATES:] * size
    estimate = Estimate(
        tuple(rng.normal(size=STATES)), rows(joint[:STATES, :STATES]), rows(joint[:STATES, STATES:])
    )
    noise = rng.normal(size=(components, components))
    update = Update(
        tuple(rng.normal(size=components)),
        rows(rng.normal(size=(components, STATES))),
        rows(rng.normal(size=(components, nuisances))),
        rows(noise @ noise.T + np.eye(components)),
    )
    return estimate, tuple(variances.tolist()), update


def rows(matrix):
    return tuple(tuple(row) for row in matrix.tolist())
