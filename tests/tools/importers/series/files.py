"""Files of time series as a stranger's script writes them, from a simulated run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.recording.salvage import read
from gritd.tools.commands import simulate

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

SCHEDULE = """ramp: 300 ms
segments:
  - {duration: 1 s, load: 60 N, slip: 0.2, speed: 0 mm/s}
  - {duration: 4 s, load: 60 N, slip: 0.2, speed: 20 mm/s}
  - {duration: 4 s, load: 60 N, slip: 0.45, speed: 25 mm/s}
"""


def simulated(folder: Path) -> Path:
    """A recording of the packaged testbed."""
    schedule, run = folder / "schedule.yaml", folder / "truth.mcap"
    schedule.write_text(SCHEDULE)
    assert simulate.main(["--schedule", str(schedule), "-o", str(run)]) == 0
    return run


def physical(run: Path) -> tuple[dict[str, tuple[Array, Array]], Settings]:
    """Times [s] from the first reading and SI values of every channel."""
    recording = read(run)
    assert recording.config_yaml is not None
    settings = config.loads(recording.config_yaml, run.name).settings
    found = {}
    for name in ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt"):
        rows, known = recording.arrays(f"/raw/{name}"), settings.channels[name].calibration
        raw = rows["count" if name.endswith("encoder") else "volts"]
        time = rows["stamp"] * 1e-9 - settings.channels[name].latency
        found[name] = (time, raw * known.scale.value + known.offset.value)

    rows = recording.arrays("/raw/wrench")
    assert settings.wrench is not None
    for axis in ("fx", "fz", "ty"):
        found[axis] = (rows["stamp"] * 1e-9 - settings.wrench.latency, rows[axis])
    start = min(time[0] for time, _ in found.values())
    return {name: (time - start, values) for name, (time, values) in found.items()}, settings


def merged(series: Mapping[str, tuple[Array, Array]]) -> dict[str, Array]:
    """One row for every instant at which any channel was read, NaN where the others were not."""
    time = np.unique(np.concatenate([t for t, _ in series.values()]))
    columns = {"time": time}
    for name, (t, values) in series.items():
        columns[name] = np.full(time.size, np.nan)
        columns[name][np.searchsorted(time, t)] = values
    return columns


def write_csv(path: Path, columns: Columns, show: Callable[[float], str] = repr) -> Path:
    """A cell without a number is empty."""
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    lines = [",".join("" if x != x else show(x) for x in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path
