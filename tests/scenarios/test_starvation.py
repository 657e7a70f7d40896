"""The process without processor time: busy neighbours, stops, the garbage collector."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time

import numpy as np

from tests.scenarios.recorded import rows, unreported, verified
from tests.scenarios.rig import WIRES, driven, service

STARVED = "CPU starvation"


# ---- starvation ----------------------------------------------------------------------------------


def test_starved_by_four_busy_processes(tmp_path, seed, figure):
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        with service(tmp_path, driven(40.0, seed, skip=1.0)) as (_, daemon):
            time.sleep(3.0)
            daemon.stop()
    finally:
        for process in busy:
            process.kill()
            process.wait()
    loop = rows(daemon.path(), "/loop")
    figure(STARVED, WIRES, "ticks missed and not reported", unreported(daemon.path()), "", 0)
    figure(
        STARVED,
        f"{WIRES}, four busy processes",
        "lateness, 99 %",
        np.quantile(loop["lateness"], 0.99) * 1e3,
        "ms",
    )
    figure(STARVED, f"{WIRES}, four busy processes", "ticks missed", int(loop["missed"][-1]), "")
    assert verified(daemon.path())


def test_stopped_for_a_while(tmp_path, seed, figure):
    rng = random.Random(seed)
    pauses = [0.1, rng.uniform(0.3, 1.0), 5.0 if seed == 1 else rng.uniform(1.0, 2.0)]
    with service(tmp_path, driven(40.0, seed, skip=1.0)) as (_, daemon):
        for pause in pauses:
            time.sleep(0.5)
            daemon.signal(signal.SIGSTOP)
            time.sleep(pause)
            daemon.signal(signal.SIGCONT)
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        assert not daemon.lines("hanging"), daemon.text
        daemon.stop()
    missed = int(rows(daemon.path(), "/loop")["missed"][-1])
    assert missed >= 0.8 * sum(pauses) * 250
    figure(
        STARVED,
        f"{WIRES}, SIGSTOP 0.1 … 5 s",
        "ticks missed and not reported",
        unreported(daemon.path()),
        "",
        0,
    )
    assert verified(daemon.path())


# ---- garbage collection --------------------------------------------------------------------------

COLLECTING = """
import gc, threading, time
def collect():
    while not any(thread.name == "loop" for thread in threading.enumerate()): time.sleep(0.1)
    time.sleep(2.0)
    heap = [[n] for n in range(1_000_000)]
    start = time.monotonic()
    gc.collect()
    print(f"collected in {time.monotonic() - start:.3f} s", flush=True)
threading.Thread(target=collect, daemon=True).start()
"""


def test_garbage_collector_pause(tmp_path, seed, figure):
    with service(tmp_path, driven(40.0, seed, skip=1.0), prelude=COLLECTING) as (_, daemon):
        daemon.heard("collected in ")
        time.sleep(0.5)
        report = daemon.status()
        daemon.stop()
    lost = sum(device["lost"] for device in report["devices"].values())
    late = np.max(rows(daemon.path(), "/loop")["lateness"])
    level = f"{WIRES}, 1e6 objects collected inside"
    figure("garbage-collector pause", level, "samples lost on the wires", lost, "", 0, real=True)
    figure(
        "garbage-collector pause",
        level,
        "samples the queue dropped",
        report["queue"]["dropped"],
        "",
        0,
    )
    figure("garbage-collector pause", level, "largest lateness", late * 1e3, "ms")
    assert unreported(daemon.path()) == 0 and verified(daemon.path())
