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
CHANGE, MORE_VOLTS = 120, 0.05  # the tick from which on the shunt reads so much more


def computed():
    """{"revision": …, run: [{field: value} at some ticks]}."""
    _, steady = run(RIG, TRUTH, THREE_LOADS, seed=1)
    ran = {"three loads": steady, "more torque from 12 s on": _altered()}
    kept = {
        name: [{field: float(tick[field]) for field in FIELDS + MORE} for tick in ticks[49::50]]
        for name, ticks in ran.items()
    }
    return {"revision": REVISION, **kept}


def _altered():
    """More torque at once: to the filter, a change of the soil."""
    pipeline, ticks = Pipeline(RIG, "plain"), []
    state = pipeline.start()
    for number, (t, batch) in enumerate(readings(RIG, TRUTH, LOADS, seed=2)):
        if number >= CHANGE:
            batch = [_more(reading) for reading in batch]
        state, tick = pipeline.step(state, batch, t)
        ticks.append(dict(zip(TICK_NAMES, tick, strict=True)))
    return ticks


def _more(reading):
    more = MORE_VOLTS if reading.channel == "motor_shunt" else None
    return reading if more is None else reading._replace(value=reading.value + more)


if __name__ == "__main__":
    KEPT.write_text(json.dumps(computed(), indent=1) + "\n", encoding="utf-8")
