"""What a daemon takes until its filter is ready: a process of its own for every repetition."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys

from gritd.estimator.config.settings import ENGINES

# The path of `gritd run` up to the first tick, on the packaged testbed, without its devices.
_READY = """
import json, sys, time
import gritd.tools.commands.run, gritd.tools.service.serve
from gritd.config import packaged
from gritd.drivers.build import build_readers
from gritd.estimator.config.configuration import load, with_engine
from gritd.estimator.online.pipeline import Pipeline
configuration = with_engine(load(packaged()), sys.argv[1])
build_readers(configuration.settings, lambda: 0, None)
pipeline = Pipeline(configuration.settings)
pipeline.step(pipeline.start(), (), 1_000_000_000)
# ru_maxrss would be that of the process which started this one, where that is the larger
lines = open("/proc/self/status", encoding="ascii").read().splitlines()
memory = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
print(json.dumps([time.process_time(), 1024 * memory]))
"""


def start(repeats: int) -> dict[str, float]:
    """Processor time [s] and largest resident memory [bytes] of a daemon that made its first tick,
    by engine, in turn; medians.
    """
    taken: dict[str, list[list[float]]] = {engine: [] for engine in ENGINES}
    for _ in range(repeats):
        for engine, starts in taken.items():
            starts.append(_ready(engine))

    figures: dict[str, float] = {}
    for engine, starts in taken.items():
        seconds, memory = (statistics.median(column) for column in zip(*starts, strict=True))
        figures |= {f"{engine}_seconds": seconds, f"{engine}_memory": memory}
    figures["over_filterpy"] = figures["filterpy_seconds"] / figures["plain_seconds"]
    return figures


def _ready(engine: str) -> list[float]:
    done = subprocess.run(
        [sys.executable, "-c", _READY, engine], capture_output=True, text=True, check=True
    )
    return list(map(float, json.loads(done.stdout)))
