"""Reports as a daemon on a full rig sends them, made up; and the daemon that sends them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gritd.estimator.daemon.publish import Publisher
from gritd.estimator.messages.status import CHANNEL_BITS
from gritd.estimator.messages.tick import TICK_NAMES, LoopRecord
from gritd.estimator.messages.update import UPDATE_NAMES

BEGAN = 1_790_000_000.0  # [s]
TICK = {
    **dict.fromkeys(TICK_NAMES, 0.0),
    **{"cohesion": 812.0, "cohesion_sigma": 35.0, "tan_phi": 0.5771, "tan_phi_sigma": 0.0123},
    **{"shear_modulus": 0.0251, "shear_modulus_sigma": 0.0011, "cov_c_tan_phi": -0.3},
    **{"slip": 0.201, "slip_sigma": 0.002, "sinkage": 0.0173, "sinkage_sigma": 1e-5},
    **{"theta_1": 0.7, "theta_1_sigma": 1e-3, "theta_m": 0.35, "load": 40.0, "load_sigma": 0.1},
    **{"torque": 1.234, "torque_sigma": 0.002, "torque_predicted": 1.3},
    **{"torque_predicted_sigma": 0.02, "drawbar_pull": -3.0, "drawbar_pull_sigma": 0.05},
    **{"drawbar_pull_predicted": -2.9, "drawbar_pull_predicted_sigma": 0.1},
    **{"load_predicted": 41.0, "load_predicted_sigma": 2.0, "drawbar_pull_max": 4.0},
    **{"consistency": 1.0, "separability": 0.3, "updates": 77, "resets": 0},
}
DEVICE = {
    **dict.fromkeys(("readings", "bad", "lost", "errors", "quarantined", "reopened"), 3),
    **{"state": "OPEN", "rate": 500.0, "last_error": "", "frames": 9},
}
SETUP = {
    "run": "sand-70N",
    "testbed": "bench <b>4</b>",
    "wheel": {"radius": 0.072, "width": 0.071, "c1": 0.5, "c2": 0.0},
    "prior": {
        "cohesion": {"value": 1000.0, "sigma": 300.0},
        "tan_phi": {"value": 0.577, "sigma": 0.06},
        "shear_modulus": {"value": 0.025, "sigma": 0.003},
    },
}


def report(at: float = 0.0, tick: Mapping[str, Any] = {}, **changes: Any) -> dict[str, Any]:
    """A report `at` seconds after BEGAN."""
    sequence = round(250 * at)
    stamp = round((BEGAN + at) * 1e9)
    loop = {**dict.fromkeys(LoopRecord._fields, 0), "stamp": stamp, "ticks": sequence}
    update = {**dict.fromkeys(UPDATE_NAMES, 0.0), "torque_sigmas": None, "updates": 77}
    return {
        "pid": 77,
        "uptime": at,
        "healthy": True,
        "hanging": "",
        "unfed": "",
        "real_time": "yes",
        "wall_clock": "",
        "configuration": "rig.yaml",
        "setup": SETUP,
        "status": "TRACKING",
        "flags": [],
        "channels": dict.fromkeys(CHANNEL_BITS, "ok"),
        "tick": {**TICK, "stamp": stamp, "evaluated": stamp, "sequence": sequence, **tick},
        "update": {**update, "stamp": stamp, "evaluated": stamp},
        "loop": {**loop, "lateness": 1e-4, "late_50": 1e-4, "late_99": 2e-4, "late_max": 3e-4},
        "disagreement": None,
        "queue": {"received": 5, "processed": 5, "dropped": 0, "queued": 0},
        "devices": {"encoders": DEVICE, "bus": DEVICE},
        "sensors": {name: {"readings": 9, "rate": 250.0, "age": 3e-3} for name in CHANNEL_BITS},
        "log": {"state": "writing", "error": "", "queued": 0, "dropped": 0, "written": 9,
                "files": 1, "file": "run.mcap", "size": 12e6, "free": 5e9},
        **changes,
    }  # fmt: skip


@contextmanager
def daemon(socket: Path, made: Callable[[float], Mapping[str, Any]] = report) -> Iterator[None]:
    """One that sends `made(seconds since its start)`, ten a second."""
    began = time.monotonic()
    publisher = Publisher(socket, lambda: made(time.monotonic() - began))
    publisher.start()
    try:
        yield
    finally:
        publisher.close()
