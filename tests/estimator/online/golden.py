"""What the filter makes of two fixed runs, kept in golden.json.

python -m tests.estimator.online.golden    # writes it anew, after a change that is meant
"""

from __future__ import annotations

import json
from pathlib import Path

from gritd.estimator.messages.tick import REVISION, TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from tests.estimator.filter.rig import RIG, TRUTH, run
from tests.linear_plant import THREE_LOADS, readings

KEPT = Path(__file__).with_name("golden.json")
FIELDS = ("status", "flags", "updates", "resets", "cohesion", "cohesion_sigma", "tan_phi")
MORE = ("tan_phi_sigma", "shear_modulus", "torque_predicted", "consistency", "separability")
LOADS = ((8.0, 50.0, 0.2), (8.0, 90.0, 0.4), (8.0, 60.0, 0.1))
CHANGE, HARDER = 120, (760.0, 0.66, 0.025)  # the tick from which on the soil is another


def computed():
    """{"revision": …, run: [{field: value} at some ticks]}."""
    _, steady = run(RIG, TRUTH, THREE_LOADS, seed=1)
    ran = {"three loads": steady, "another soil from 12 s on": _altered()}
    kept = {
        name: [{field: float(tick[field]) for field in FIELDS + MORE} for tick in ticks[9::10]]
        for name, ticks in ran.items()
    }
    return {"revision": REVISION, **kept}


def _altered():
    """The soil changes at once."""
    pipeline, ticks = Pipeline(RIG, "plain"), []
    state = pipeline.start()
    softer, harder = (readings(RIG, soil, LOADS, seed=2) for soil in (TRUTH, HARDER))
    for number, (before, after) in enumerate(zip(softer, harder, strict=True)):
        t, batch = before if number < CHANGE else after
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    return ticks


if __name__ == "__main__":
    KEPT.write_text(json.dumps(computed(), indent=1) + "\n", encoding="utf-8")
