"""What a writer leaves that is killed by kill -9."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gritd.estimator.recording.salvage import read

REPOSITORY = Path(__file__).parents[3]

LOGGING = """
import sys, time
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.writer import WriterThread
thread = WriterThread(sys.argv[1], [], "a: 1", RunInfo("killed"))
thread.start()
i, start = 0, time.monotonic()
while True:
    while i < (time.monotonic() - start) * 1250:
        now = time.monotonic_ns()
        thread.put([Reading(now, "wheel_encoder", i, now)])
        i += 1
    if thread.status().written:
        print(i, flush=True)
    time.sleep(0.002)
"""


@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(3, 20))]
)
def test_kill_9_leaves_everything_up_to_the_last_flush(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "run.mcap"
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "OPENBLAS_NUM_THREADS": "1"}
    child = subprocess.Popen(
        [sys.executable, "-c", LOGGING, str(path)], stdout=subprocess.PIPE, env=environment
    )
    try:
        assert child.stdout and child.stdout.readline()
        time.sleep(random.Random(seed).uniform(0.3, 1.3))
    finally:
        killed = time.monotonic_ns()
        child.send_signal(signal.SIGKILL)
        child.wait()
    recording = read(path)
    rows = recording.arrays("/raw/wheel_encoder")
    print(
        f"killed: {(killed - rows['stamp'][-1]) / 1e9:.3f} s of data lost,"
        f" {len(rows)} messages kept"
    )
    assert rows["count"].tolist() == list(range(len(rows))) and len(rows) > 0
    assert (
        not recording.closed and recording.config_yaml == "a: 1" and recording.run.name == "killed"
    )
    assert (
        killed - rows["stamp"][-1]
    ) / 1e9 < 5.0  # the figure is printed; only a writer that stopped fails here
