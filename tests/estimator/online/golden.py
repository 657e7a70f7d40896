"""What the filter makes of two fixed runs, kept in golden.json, and a recording to be verified bit
for bit, golden.mcap: the packaged testbed at 50 Hz, a standstill and two loads.

python -m tests.estimator.online.golden    # writes it anew, after a change that is meant
"""

from __future__ import annotations

import json
import tempfile
from contextlib import chdir
from pathlib import Path

import yaml

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.config.yamltree import dumped
from gritd.estimator.messages.tick import REVISION, TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from gritd.tools.commands import replay, simulate
from tests.estimator.filter.rig import RIG, TRUTH, run
from tests.linear_plant import THREE_LOADS, readings

KEPT = Path(__file__).with_name("golden.json")
RECORDED = KEPT.with_suffix(".mcap")
FIELDS = ("status", "flags", "updates", "resets", "cohesion", "cohesion_sigma", "tan_phi")
MORE = ("tan_phi_sigma", "shear_modulus", "torque_predicted", "consistency", "separability")
LOADS = ((8.0, 50.0, 0.2), (8.0, 90.0, 0.4), (8.0, 60.0, 0.1))
SCHEDULE = """
ramp: 300 ms
segments:
  - {duration: 1 s, load: 45 N, slip: 0.1, speed: 0 mm/s}
  - {duration: 3 s, load: 45 N, slip: 0.15, speed: 20 mm/s}
  - {duration: 3 s, load: 90 N, slip: 0.4, speed: 20 mm/s}
"""
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


def record():
    """Write golden.mcap, made in a folder that is nobody's."""
    document = yaml.safe_load(load(packaged()).text)
    document["rates"]["tick"] = "50 Hz"
    document["devices"]["bus"]["dbc"] = "testbed.dbc"  # beside it
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("testbed.yaml").write_text(dumped(document), encoding="utf-8")
        Path("testbed.dbc").write_bytes(packaged().with_name("testbed.dbc").read_bytes())
        Path("schedule.yaml").write_text(SCHEDULE, encoding="utf-8")
        given = ("--config", "testbed.yaml", "--schedule", "schedule.yaml")
        simulate.main([*given, "-o", "golden.mcap"])
        RECORDED.unlink(missing_ok=True)
        replay.main(["golden.mcap", "-o", str(RECORDED)])


if __name__ == "__main__":
    record()
    KEPT.write_text(json.dumps(computed(), indent=1) + "\n", encoding="utf-8")
