"""What is compiled gives the bits of the Python beside it, so that a recording does not tell which
of them computed it.
"""

from __future__ import annotations

import runpy
import subprocess
import sys
from dataclasses import replace
from math import nan
from pathlib import Path
from shutil import copytree, ignore_patterns

import numpy as np
import pytest

from gritd.estimator.compiled import arithmetic, sources
from gritd.estimator.filter import estimate as algebra
from gritd.estimator.filter.estimate import STATES, Update, made, rows
from gritd.estimator.filter.evidence import evidence
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.measurement import Measurement
from gritd.estimator.filter.model import FormError
from gritd.estimator.filter.plain_engine import CompiledEngine, PlainEngine
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator import live_run
from tests.estimator.live_run import SETTINGS
from tests.rig import TRIANGLES

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
    triangles = replace(SETTINGS, effects=(TRIANGLES,))
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
        answered += built._closed.predict(*at, 0.0, 0.0, 0.0) is not None
    assert answered > 0.7 * DRAWS


MOVED = FormError(0.05, 0.04, -0.06)


def test_another_shape_of_the_stresses_is_that_of_python_to_the_bit(monkeypatch):
    built, python = models(monkeypatch, SETTINGS)
    for at in drawn(seed=8):
        assert built.predict(*at, MOVED) == python.predict(*at, MOVED)


def test_the_carried_load_is_that_of_python_to_the_bit(monkeypatch):
    built, python = models(monkeypatch, SETTINGS)
    for c, tan_phi, k, theta_1, slip, stress in drawn(seed=9):
        at = (c, tan_phi, k, theta_1, slip, 100.0 * stress)
        assert built._carried(*at, MOVED) == python._carried(*at, MOVED)


@pytest.mark.parametrize("place", range(6))
def test_what_is_no_number_is_left_to_python(place):
    closed = Measurement(SETTINGS).model._closed
    at = [900.0, 0.6, 0.025, 0.6, 0.3, 70.0]
    assert closed.predict(*at, 0.0, 0.0, 0.0) is not None
    at[place] = nan
    assert closed.predict(*at, 0.0, 0.0, 0.0) is None


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("beside", [0, 1, 8, 40])
def test_an_update_is_that_of_python_to_the_bit(components, beside):
    rng = np.random.default_rng(components + 10 * beside)
    for _ in range(100):
        estimate, update = _drawn(rng, components, STATES + beside)
        plain = PlainEngine().update(estimate, update)
        assert CompiledEngine().update(estimate, update) == plain
        for h in update.H:
            there = algebra.plain_variance(estimate, h)
            assert algebra.variance(estimate, h) == there


@pytest.mark.parametrize("members", [1, 2, 3])
def test_a_mixture_is_that_of_python_to_the_bit(members):
    rng = np.random.default_rng(members)
    for _ in range(50):
        drawn = [_drawn(rng, 1, 12)[0] for _ in range(members)]
        weights = rng.dirichlet(np.ones(members)).tolist()
        assert algebra.mixed(drawn, weights) == (
            drawn[0] if members == 1 else algebra.plain_mixed(drawn, weights)
        )


def _spread(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


def _drawn(rng, components, size):
    estimate = made(tuple(rng.normal(size=size).tolist()), _spread(rng, size))
    update = Update(
        tuple(rng.normal(size=components).tolist()),
        rows(rng.normal(size=(components, size))),
        rows(_spread(rng, components)),
    )
    return estimate, update


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("beside", [0, 2, 9, 30])
@pytest.mark.parametrize("stretches", [1, 2, 36])
def test_the_evidence_of_a_change_is_that_of_python_to_the_bit(components, beside, stretches):
    rng = np.random.default_rng(components + 10 * beside + stretches)
    for _ in range(10):
        before, _ = _drawn(rng, components, STATES + beside)
        lines = [_line(rng, components, STATES + beside) for _ in range(stretches)]
        windows = rng.integers(1, 40, stretches).tolist()
        known = ((0.3, 0.06, 0.1), lines, windows, 0.003)
        python = evidence(before, *known)
        assert arithmetic.evidence(before.x, before.packed, *known) == python
        assert all(np.isfinite(python[0]))


def _line(rng, components, size):
    _, (y, H, R) = _drawn(rng, components, size)
    return Line(y, H, R, rows(_spread(rng, components)), (0.1, 1.0)[:components])


@pytest.mark.long
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


@pytest.mark.parametrize("built", [True, False])
def test_a_sum_is_made_term_by_term(built, monkeypatch):
    """In every version of Python: `sum` gives 2 since 3.12."""
    monkeypatch.setattr(arithmetic, "BUILT", built)
    assert arithmetic.total([1.0, 1e100, 1.0, -1e100]) == 0.0
    assert arithmetic.total([]) == 0.0


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
    with pytest.raises(ValueError, match="10 x 14 x 120"):
        arithmetic.Closed(tuple, (0.1, 0.1, 0.5, 0.0), 0.0, (0.0, 1.0), (0.0, 1.0), b"12345678")


@pytest.mark.parametrize("change, used", [("", True), ("\n/* of the next version */\n", False)])
def test_what_an_older_version_left_is_not_used(change, used, tmp_path, monkeypatch):
    """The modules stay where the next version is installed without a compiler."""
    folder = Path(sources.__file__).parent
    copytree(folder, tmp_path / "compiled", ignore=ignore_patterns("*.so"))
    with open(tmp_path / "compiled" / "tuples.h", "a", encoding="utf-8") as file:
        file.write(change)
    monkeypatch.setattr(sources, "__file__", str(tmp_path / "compiled" / "sources.py"))

    for wrapper in ("arithmetic.py", "records.py", "whitening.py"):
        assert runpy.run_path(str(folder / wrapper))["BUILT"] is used


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
