"""The two engines: each is loaded only where it is configured."""

from __future__ import annotations

import subprocess
import sys

import pytest

from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.engine import make_engine

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
