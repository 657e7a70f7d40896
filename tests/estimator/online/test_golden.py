"""The numbers of /tick change on purpose only."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys

import pytest

from gritd.estimator.messages.status import Flag
from tests.estimator.online import golden

ANEW = (
    "/tick is another: if that is meant, raise REVISION in estimator/messages/tick.py and run "
    "python -m tests.estimator.online.golden"
)


def test_the_same_readings_give_the_same_ticks_until_the_revision_is_raised():
    kept, computed = json.loads(golden.KEPT.read_text(encoding="utf-8")), golden.computed()
    assert kept["revision"] == computed["revision"], ANEW
    for name in kept.keys() - {"revision"}:
        for was, now in zip(kept[name], computed[name], strict=True):
            assert now == pytest.approx(was, rel=1e-6, abs=1e-12, nan_ok=True), f"{name}: {ANEW}"


def test_they_hold_a_change_of_the_soil():
    flags = [int(tick["flags"]) for tick in golden.computed()["another soil from 12 s on"]]
    assert any(flag & Flag.CHANGED for flag in flags)


VERIFY = """
import sys
if sys.argv.pop(1) == "in Python":
    sys.modules.update({f"gritd.estimator.compiled.{name}": None for name in ("algebra", "closed")})
from gritd.tools.main import main
sys.exit(main(["replay", "--verify", *sys.argv[1:]]))
"""


@pytest.mark.parametrize("arithmetic", ["compiled", "in Python"])
def test_every_python_verifies_the_recording_bit_for_bit(arithmetic):
    """CI does so with each version."""
    command = [sys.executable, "-c", VERIFY, arithmetic, str(golden.RECORDED)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}{ANEW}"


HASHED = """
import hashlib, numpy
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator import live_run
pipeline, ticks = Pipeline(live_run.SETTINGS), hashlib.sha256()
state = pipeline.start()
for stamp, batch in live_run.consumed(live_run.SCHEDULE[:2]):
    state, row = pipeline.step(state, batch, stamp)
    ticks.update(numpy.array(row).tobytes())
print(ticks.hexdigest(), state.track.updates)
"""
OTHER = {"OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX2 FMA3"}


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the kernels are those of x86-64")
@pytest.mark.long
def test_the_ticks_are_the_same_to_the_bit_on_another_processor():
    """Without the instructions that OpenBLAS and numpy choose by the processor."""

    def ticks(**more):
        command = [sys.executable, "-W", "ignore", "-c", HASHED]
        done = subprocess.run(
            command, capture_output=True, text=True, check=True, env={**os.environ, **more}
        )
        return done.stdout.split()

    here = ticks()
    assert int(here[1]) > 20
    assert ticks(**OTHER) == here
