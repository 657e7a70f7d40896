"""Held-out errors against the noiseless truth, on traces made by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gritd.tools.proof.blind import heldout
from gritd.tools.proof.blind.strata import Assignment
from gritd.tools.proof.blind.trial import WorkerSpec

TIME = np.linspace(0.0, 10.0, 51)
BEGINS = 300.0  # [s] since the campaign began


@pytest.mark.parametrize("later", [0.0, heldout.DAY])
@pytest.mark.parametrize("bed", ["", "same"])
def test_errors_are_of_the_samples_that_were_used(tmp_path: Path, later: float, bed: str) -> None:
    """Times of a pair count from the new campaign or from its reference, a day before."""
    spec = WorkerSpec(1, 2, Assignment("pair"), str(tmp_path))
    spec.answers.parent.mkdir(parents=True)
    name = "new-2" if bed else "run-2"
    np.savez(spec.answers.with_name(f"{spec.name}.{name}.npz"), time=TIME, torque=2.0 * TIME)
    used = TIME < 5.0
    trace: dict[str, Any] = {
        "run": name,
        "channel": "torque",
        "time": (BEGINS + later + TIME).tolist(),
        "measured": (2.0 * TIME + 0.1).tolist(),
        "before": (2.0 * TIME + 1.1).tolist(),
        "after": [value if ok else None for value, ok in zip(2.0 * TIME + 0.4, used, strict=True)],
        "used": used.astype(float).tolist(),
    }
    answers = {"bed": bed, "runs": [{"begins": 0.0}, {"begins": BEGINS}]}
    found = heldout.errors({"traces": [trace]}, answers, spec)
    assert found["torque"] == pytest.approx((1.0, 0.3, 0.1))
