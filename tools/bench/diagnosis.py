"""What a diagnosis takes: processor time and memory of `gritd diagnose`, against the number of runs
and against their length, with the exponents of the power laws that fit.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import simulate_run, soil_of

RIM_SPEED = 0.02  # [m/s]
LOADS = (40.0, 70.0, 100.0)  # [N] of the runs in turn
SLIPS = (0.1, 0.2, 0.3, 0.45, 0.6)
SHORT = 60.0  # [s] of each run where there are several
RUNS = (2, 4, 8, 24)
ON_CORES = 6, 2  # runs that are diagnosed by so many processes on as many cores
LENGTHS = (300.0, 600.0, 1200.0)  # [s] of one run

# Memory is measured by the process itself: by wait4 it would be that of whoever started it, where
# that is the larger.
_MEASURED = """
import json, os, sys, time
began, cores = time.perf_counter(), int(sys.argv[1])
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])
from gritd.tools.main import main
code = main([*sys.argv[2:], "--jobs", sys.argv[1]])
lines = open("/proc/self/status", encoding="ascii").read().splitlines()
memory = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
print(json.dumps([time.process_time(), 1024 * memory, time.perf_counter() - began]))
sys.exit(code)
"""

Figures = dict[str, float]


def diagnosis(
    folder: Path, runs: Sequence[int] = RUNS, lengths: Sequence[float] = LENGTHS
) -> Figures:
    """Processor time [s] and largest memory [bytes] on one core, of simulated runs with nothing
    left out; and by the wall clock on several.
    """
    written = [_written(folder, number, SHORT) for number in range(max(runs))]
    by_runs = [_diagnosed(written[:count])[:2] for count in runs]
    by_length = [_diagnosed([_written(folder, 100 + n, s)])[:2] for n, s in enumerate(lengths)]
    several, cores = min(ON_CORES[0], len(written)), ON_CORES[1]
    elapsed = _diagnosed(written[:several], cores)[2]

    figures: Figures = {}
    for count, (seconds, memory) in zip(runs, by_runs, strict=True):
        figures |= {f"{count}_runs_seconds": seconds, f"{count}_runs_memory": memory}
    for length, (seconds, memory) in zip(lengths, by_length, strict=True):
        figures |= {f"{length:g}_s_seconds": seconds, f"{length:g}_s_memory": memory}
    return figures | {
        f"{several}_runs_on_{cores}_cores_elapsed": elapsed,
        "exponent_of_runs": exponent(runs, [seconds for seconds, _ in by_runs]),
        "exponent_of_length": exponent(lengths, [seconds for seconds, _ in by_length]),
    }


def exponent(sizes: Sequence[float], times: Sequence[float]) -> float:
    """p of time = a sizeᵖ, by least squares of the logarithms."""
    slope, _ = np.polyfit(np.log(sizes), np.log(times), 1)
    return float(slope)


def _written(folder: Path, number: int, seconds: float) -> Path:
    """The recording of a run at one load."""
    configuration = config.load(packaged())
    settings, load = configuration.settings, LOADS[number % len(LOADS)]
    each = seconds / len(SLIPS)
    schedule = Schedule(
        tuple(Segment(each, load, slip, RIM_SPEED) for slip in SLIPS), min(0.5, each / 4.0)
    )
    motion = motion_of(schedule, settings.wheel.radius, settings.rates.tick)
    run = simulate_run(settings, soil_of(settings), motion, (), number)

    path = folder / f"diagnosed-{number}.mcap"
    info = RunInfo(name=path.stem, nominal_load=load)
    writer = RunWriter(path, (), configuration.text, info)
    for reading in run.readings:
        writer.reading(reading)
    writer.close()
    return path


def _diagnosed(paths: Sequence[Path], cores: int = 1) -> tuple[float, float, float]:
    """Processor time [s] and largest memory [bytes] of the process alone, and the time that went by
    [s]. Raises CalledProcessError.
    """
    command = ["diagnose", *map(str, paths), "--config", str(packaged()), "--seed", "0"]
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, str(cores), *command],
        capture_output=True,
        text=True,
        check=True,
    )

    seconds, memory, elapsed = json.loads(done.stdout.splitlines()[-1])
    return float(seconds), float(memory), float(elapsed)
