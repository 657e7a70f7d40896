"""What is compiled gives the bits of the Python beside it, so that a recording does not tell which
of them computed it.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from math import nan

import numpy as np
import pytest

from gritd.estimator.compiled import arithmetic
from gritd.estimator.filter import estimate as algebra
from gritd.estimator.filter.estimate import STATES, Estimate, Update
from gritd.estimator.filter.evidence import evidence
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.measurement import Measurement
from gritd.estimator.filter.plain_engine import CompiledEngine, PlainEngine
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator import live_run
from tests.estimator.live_run import SETTINGS

pytestmark = pytest.mark.skipif(
    not arithmetic.BUILT, reason="gritd was installed without a compiler"
)

DRAWS = 2000


def models(monkeypatch, settings):
    """The same model compiled and in Python."""
    built = Measurement(settings).model
    monkeypatch.setattr(arithmetic, "BUILT", False)
    return built, Measurement(settings).model


def wheels():
    """The packaged rig with the true stresses and with the triangles, θₘ fixed and not."""
    triangles = replace(SETTINGS, effects=())
    moving = replace(SETTINGS.wheel, c1=0.4, c2=0.2)
    return {
        "true stresses": SETTINGS,
        "triangles": triangles,
        "moving peak": replace(SETTINGS, wheel=moving),
        "moving peak of triangles": replace(triangles, wheel=moving),
    }


def drawn(seed):
    """c, tan φ, k, θ₁, i, W: in and beyond the table's range, the delicate cases included."""
    rng = np.random.default_rng(seed)
    for _ in range(DRAWS):
        yield (
            *rng.uniform((0.0, 0.05, 0.001), (5000.0, 1.5, 0.2)).tolist(),
            *rng.uniform((0.02, -0.1, 1.0), (1.57, 1.0, 200.0)).tolist(),
        )


@pytest.mark.parametrize("name", wheels())
def test_forces_and_gradients_are_those_of_python_to_the_bit(monkeypatch, name):
    built, python = models(monkeypatch, wheels()[name])
    answered = 0
    for at in drawn(seed=7):
        assert built.predict(*at) == python.predict(*at)
        answered += built._closed.predict(*at, 0.0) is not None
    assert answered > 0.7 * DRAWS


def test_an_error_of_the_exponent_is_that_of_python_to_the_bit(monkeypatch):
    monkeypatch.setattr("gritd.estimator.filter.shift.REMEMBERED", 0)
    built, python = models(monkeypatch, SETTINGS)
    built._exponent_error = python._exponent_error = 0.05
    for at in drawn(seed=8):
        assert built.predict(*at) == python.predict(*at)


def test_the_carried_load_is_that_of_python_to_the_bit(monkeypatch):
    built, python = models(monkeypatch, SETTINGS)
    for c, tan_phi, k, theta_1, slip, stress in drawn(seed=9):
        at = (c, tan_phi, k, theta_1, slip, 100.0 * stress)
        assert built._carried(*at) == python._carried(*at)


@pytest.mark.parametrize("place", range(6))
def test_what_is_no_number_is_left_to_python(place):
    closed = Measurement(SETTINGS).model._closed
    at = [900.0, 0.6, 0.025, 0.6, 0.3, 70.0]
    assert closed.predict(*at, 0.0) is not None
    at[place] = nan
    assert closed.predict(*at, 0.0) is None


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("nuisances", [0, 1, 8, 20])
@pytest.mark.parametrize("consider_k", [False, True])
def test_an_update_is_that_of_python_to_the_bit(components, nuisances, consider_k):
    rng = np.random.default_rng(components + 10 * nuisances)
    variances = tuple(rng.uniform(0.0, 1.0, nuisances).tolist())
    for _ in range(200):
        estimate, update = _drawn(rng, components, nuisances)
        plain = PlainEngine(variances).update(estimate, update, consider_k)
        assert CompiledEngine(variances).update(estimate, update, consider_k) == plain
        for h, g in zip(update.H, update.G, strict=True):
            for felt in (g, ()):
                there = algebra.plain_variance(estimate, variances, h, felt)
                assert algebra.variance(estimate, variances, h, felt) == there


def _drawn(rng, components, nuisances):
    def spread(size):
        root = rng.normal(size=(size, size))
        return root @ root.T + 0.1 * np.eye(size)

    def rows(array):
        return tuple(map(tuple, np.asarray(array).tolist()))

    estimate = Estimate(
        tuple(rng.normal(size=STATES).tolist()),
        rows(spread(STATES)),
        rows(rng.normal(size=(STATES, nuisances)) * 0.1),
    )
    update = Update(
        tuple(rng.normal(size=components).tolist()),
        rows(rng.normal(size=(components, STATES))),
        rows(rng.normal(size=(components, nuisances))),
        rows(spread(components)),
    )
    return estimate, update


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("nuisances", [0, 2, 9, 20])
@pytest.mark.parametrize("stretches", [1, 2, 36])
def test_the_evidence_of_a_change_is_that_of_python_to_the_bit(components, nuisances, stretches):
    rng = np.random.default_rng(components + 10 * nuisances + stretches)
    variances = tuple((0.1 + rng.uniform(0.0, 1.0, nuisances)).tolist())
    for _ in range(20):
        before, _ = _drawn(rng, components, nuisances)
        before = before._replace(cross=tuple((0.01 * v,) * nuisances for v in before.x))
        lines = [_line(rng, components, nuisances) for _ in range(stretches)]
        windows = rng.integers(1, 40, stretches).tolist()
        known = (before, variances, (0.3, 0.06, 0.1), lines, windows)
        python = evidence(*known)
        assert arithmetic.evidence(*before, *known[1:]) == python
        assert all(np.isfinite(python[0]))


def _line(rng, components, nuisances):
    _, (y, H, G, R) = _drawn(rng, components, nuisances)
    _, (_, _, _, D) = _drawn(rng, components, nuisances)
    return Line(y, H, G, R, D)


def test_ticks_are_those_of_python_to_the_bit(monkeypatch):
    consumed = live_run.consumed()

    def rows():
        pipeline = Pipeline(SETTINGS)
        state, rows = pipeline.start(), []
        for stamp, batch in consumed:
            state, row = pipeline.step(state, batch, stamp)
            rows.append(np.array(row).tobytes())
        return rows

    built = rows()
    monkeypatch.setattr(arithmetic, "BUILT", False)
    assert built == rows()


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ((1.0, 2.0), (), (), (), ()),
        (((1.0,) * 3,) * 3, ((), (), ()), (), ("a", "b", "c"), ()),
        (((1.0,) * 3,) * 3, ((), (), ()), (0.0,) * 1000, (1.0,) * 3, ()),
    ],
)
def test_what_is_no_vector_is_refused(arguments):
    with pytest.raises((TypeError, ValueError)):
        arithmetic.variance(*arguments)


def test_a_table_of_another_size_is_refused():
    with pytest.raises(ValueError, match="14 x 14 x 24"):
        arithmetic.Closed(tuple, (0.1, 0.1, 0.5, 0.0), 0.0, (0.0, 1.0), (0.0, 1.0), b"12345678")


DENIED = """
import ctypes
# PR_SET_MDWE, PR_MDWE_REFUSE_EXEC_GAIN: what MemoryDenyWriteExecute of the unit comes to
refused = ctypes.CDLL(None, use_errno=True).prctl(65, 1, 0, 0, 0)
from gritd.estimator.compiled import arithmetic
print("not known here" if refused else arithmetic.BUILT)
"""


def test_it_loads_where_no_memory_may_become_executable():
    done = subprocess.run([sys.executable, "-c", DENIED], capture_output=True, text=True)
    if "not known here" in done.stdout:
        pytest.skip("this kernel does not know PR_SET_MDWE")
    assert done.stdout.strip() == "True", done.stderr
