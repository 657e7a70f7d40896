"""How it holds out: simulated hours through the pipeline, then the real daemon on wires under load.

python -m gritd.tools.dev.soak [--hours 100] [--minutes 60] [--busy 2] [--part 2]
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import ENGINES, Rates, Settings
from gritd.estimator.messages.readings import ENCODERS, NS, Reading
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.child import Child
from gritd.tools.cli.command import DONE, FAILED, Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.progress import Progress
from gritd.tools.service.client import connected, reports
from gritd.tools.testbed import plant
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.sensors import readings
from gritd.tools.testbed.testbed import PLAYED

LAP = 300.0  # [s] a simulated run, driven again and again
NOISES = 12  # of it: every lap has other noise than the eleven before
SLOPE = 1.0  # [MB/h] largest growth of memory
# [MB] what may come by and by without being a leak: CPython keeps freed tuples, up to 2,000 of each
# length, once a path through the code has been taken
KEPT = 0.5
PREPARED, READY = (
    1200.0,
    120.0,
)  # [s] the longest it may take to simulate the run, and to open the devices
DRAINED = 1.0  # [s] in which the daemon takes what is still on the wires
SETTLED = 0.2  # share of the time after which memory has settled
READ = [
    TICK_NAMES.index(name)
    for name in ("cohesion", "tan_phi", "cohesion_sigma", "tan_phi_sigma", "resets", "updates")
]


def main(argv: Sequence[str] | None = None) -> int:
    """Exit 1 if memory grows, a descriptor or thread stays, an estimate fails or a loss is not
    reported.
    """
    parser = Parser(
        prog="python -m gritd.tools.dev.soak", description="Run for long, and look at what grows."
    )
    parser.add_argument(
        "--hours",
        type=float,
        default=100.0,
        help="simulated, through the pipeline; default 100, 0: none",
    )
    parser.add_argument(
        "--tick", type=float, default=20.0, help="ticks a simulated second; default 20"
    )
    parser.add_argument(
        "--thin",
        type=int,
        default=5,
        help="of the readings of 250 Hz take one in so many; default 5",
    )
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default="plain",
        help="of the pipeline; default plain",
    )
    parser.add_argument(
        "--minutes", type=float, default=60.0, help="of the daemon on wires; default 60, 0: none"
    )
    parser.add_argument(
        "--busy", type=int, default=2, help="busy processes beside the daemon; default 2"
    )
    parser.add_argument(
        "--part",
        type=float,
        default=2.0,
        help="minutes of a part of the recording: many ends an hour; default 2",
    )
    parser.add_argument("--seed", type=int, default=1)

    arguments = parser.parse_args(argv)
    failures = simulated(arguments) if arguments.hours else []
    failures += on_wires(arguments) if arguments.minutes else []

    for failure in failures:
        print(f"failed: {failure}", file=sys.stderr)

    return FAILED if failures else DONE


# --- the pipeline ---


def simulated(arguments: Namespace) -> list[str]:
    """Laps of the simulated testbed, one after the other without a pause; what was not right."""
    settings = config.load(packaged()).settings
    pool = [thinned(lap, arguments.thin) for lap in driven(settings, arguments.seed)]
    settings = replace(
        settings, effects=(), rates=Rates(tick=arguments.tick)
    )  # of the linear plant

    pipeline = Pipeline(settings, arguments.engine)
    state, began, memory, ticks = pipeline.start(), time.monotonic(), [], 0
    unfit = 0

    with Progress("laps", max(1, round(arguments.hours * 3600.0 / LAP))) as progress:
        for number, batches in enumerate(laps(pool, arguments.hours, round(NS / arguments.tick))):
            for stamp, batch in batches:
                state, record = pipeline.step(state, batch, stamp)
                unfit += not all(math.isfinite(record[place]) for place in READ)
                ticks += 1
            memory.append((number * LAP / 3600.0, resident(os.getpid())))
            progress.advance()

    slope = growth(memory)
    last = dict(zip(TICK_NAMES, record, strict=True))
    print(
        f"pipeline ({arguments.engine}): {ticks} ticks of {arguments.tick:g} Hz, "
        f"one reading in {arguments.thin}, {number + 1} laps of {LAP / 60:g} min "
        f"({(number + 1) * LAP / 3600:.1f} h simulated), {len(pool)} noises, "
        f"in {time.monotonic() - began:.0f} s, {unfit} ticks without a finite estimate, "
        f"{last['updates']} updates, {last['resets']} resets, memory {memory[-1][1]:.1f} MB, "
        f"{slope:+.3f} MB per simulated hour",
        flush=True,
    )

    wrong = [f"{unfit} unfit ticks"] * bool(unfit) + leak(memory)
    return wrong + [f"{last['resets']} false resets"] * bool(last["resets"])


def driven(settings: Settings, seed: int) -> Iterator[list[Reading]]:
    """The same lap on the same soil, with noise of its own each time."""
    soil = plant.drawn_soil(settings, np.random.default_rng(seed))
    motion = motion_of(plant.schedule(LAP), settings.wheel.radius, settings.rates.tick)
    response = plant.linear_response(settings, soil, motion)
    with Progress("noises", NOISES) as progress:
        for number in range(NOISES):
            yield readings(settings, motion, response, np.random.default_rng((seed, number)))
            progress.advance()


def thinned(readings: Sequence[Reading], by: int) -> list[Reading]:
    """One reading in `by` of every channel."""
    seen: Counter[str] = Counter()
    kept = []
    for reading in readings:
        seen[reading.channel] += 1
        if seen[reading.channel] % by == 0:
            kept.append(reading)
    return kept


def laps(
    pool: Sequence[Sequence[Reading]], hours: float, period: int
) -> Iterator[Iterator[tuple[int, list[Reading]]]]:
    """(tick time, readings) of lap after lap: stamps go on, and so do the encoders' counts."""
    by, turned = 0, Counter(dict.fromkeys(ENCODERS, 0))
    ordered = [sorted(lap, key=lambda reading: reading.received) for lap in pool]

    for number in range(max(1, round(hours * 3600.0 / LAP))):
        lap, done = ordered[number % len(ordered)], dict(turned)
        moved = (later(reading, by, done) for reading in lap)
        ticks = groupby(moved, key=lambda reading: -(-reading.received // period) * period)
        yield ((stamp, list(batch)) for stamp, batch in ticks)
        by += lap[-1].received - lap[0].received + period
        turned.update(
            {name: next(r.value for r in reversed(lap) if r.channel == name) for name in ENCODERS}
        )


def later(reading: Reading, by: int, turned: Mapping[str, Any]) -> Reading:
    value = reading.value + turned[reading.channel] if reading.channel in turned else reading.value
    return reading._replace(stamp=reading.stamp + by, received=reading.received + by, value=value)


def resident(pid: int) -> float:
    """Memory of a process [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def growth(memory: Sequence[tuple[float, float]]) -> float:
    """Slope of (hours, MB) after it has settled [MB/h]."""
    settled = np.array(memory[int(SETTLED * len(memory)) :])
    return float(np.polyfit(settled[:, 0], settled[:, 1], 1)[0]) if len(settled) > 2 else 0.0


def leak(memory: Sequence[tuple[float, float]]) -> list[str]:
    """What is wrong with (hours, MB): growth that is faster than SLOPE and larger than KEPT."""
    slope = growth(memory)
    grown = slope * (memory[-1][0] - memory[int(SETTLED * len(memory))][0])
    return [f"memory grows by {slope:.2f} MB/h"] * (slope > SLOPE and grown > KEPT)


# --- the daemon ---


def on_wires(arguments: Namespace) -> list[str]:
    """Testbed and daemon as processes, and busy ones beside them; what was not right."""
    seconds = arguments.minutes * 60.0
    os.environ.update(unit_environment())

    with tempfile.TemporaryDirectory() as name, busy(arguments.busy):
        options = [
            "--folder",
            name,
            "--wait",
            "--seconds",
            str(seconds + 10.0),
            "--plant",
            "linear",
        ]
        with Child(StopRequest(), "testbed", "gritd.tools.testbed.testbed", *options) as testbed:
            path = testbed.wait_for("configuration ", PREPARED).split(" ", 1)[1]
            shorten_parts(Path(path), arguments.part)
            with Child(
                StopRequest(),
                "daemon",
                "gritd",
                "run",
                "--config",
                path,
                "--name",
                "soak",
                "--status",
                "0",
            ) as daemon:
                daemon.wait_for("device ", READY)
                daemon.wait_for("device ", READY)

                testbed.tell("play")
                looks = list(watched(Path(name) / "gritd.sock", seconds))
                testbed.stop()
                time.sleep(DRAINED)
                last = look(Path(name) / "gritd.sock")
                words = daemon.stop()

        played = json.loads((Path(name) / PLAYED).read_text(encoding="utf-8"))
    return [*judged(looks, words, arguments), *unreported(last, played)]


def shorten_parts(path: Path, minutes: float) -> None:
    """Let a part of the recording end after so long: what the end of a part needs has then settled
    when it counts.
    """
    text, replaced = re.subn(
        r"(?m)^( +part_time:).*$", rf"\g<1> {minutes:g} min", path.read_text(encoding="utf-8")
    )
    assert replaced == 1, f"{path}: part_time stands there {replaced} times"
    path.write_text(text, encoding="utf-8")


def unit_environment() -> dict[str, str]:
    """What the service's unit sets."""
    text = Path(packaged("gritd.service")).read_text(encoding="utf-8")
    lines = [
        line.removeprefix("Environment=")
        for line in text.splitlines()
        if line.startswith("Environment=")
    ]
    return dict(setting.split("=", 1) for line in lines for setting in line.split())


@contextmanager
def busy(number: int) -> Iterator[None]:
    processes = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(number)
    ]
    try:
        yield
    finally:
        for process in processes:
            process.send_signal(signal.SIGKILL)
            process.wait()


def watched(path: Path, seconds: float) -> Iterator[dict[str, Any]]:
    """A look at the daemon every few seconds, and a line of it every tenth of the time."""
    began, printed = time.monotonic(), 0
    while (passed := time.monotonic() - began) < seconds:
        yield (report := look(path))

        if int(10.0 * passed / seconds) > printed:
            printed = int(10.0 * passed / seconds)
            print(
                f"after {passed / 60:.1f} min: {report['memory']:.2f} MB, "
                f"load {report['load']:.1f}",
                flush=True,
            )
        time.sleep(min(5.0, seconds / 50))


def look(path: Path) -> dict[str, Any]:
    """The daemon's report, with its memory, descriptors and threads."""
    with connected(str(path)) as connection:
        report = next(reports(connection))
    pid = report["pid"]
    report["memory"] = resident(pid)
    report["descriptors"] = len(os.listdir(f"/proc/{pid}/fd"))
    report["threads"] = len(os.listdir(f"/proc/{pid}/task"))
    report["load"] = os.getloadavg()[0]
    return report


def unreported(last: dict[str, Any], played: dict[str, Any]) -> list[str]:
    """What was sent and neither received nor counted as lost at either end; a reading is a message
    or more.
    """
    devices = last["devices"].values()
    known = sum(device["lost"] + device["bad"] for device in devices) + sum(played["lost"].values())
    received = last["queue"]["received"]

    print(
        f"testbed: {played['readings']} readings sent, {received} received, "
        f"{known} messages known to be lost"
    )

    missing = played["readings"] - received
    return [f"{missing} readings missing, {known} messages counted as lost"] * (missing > known)


def judged(
    looks: Sequence[dict[str, Any]], words: Sequence[str], arguments: Namespace
) -> list[str]:
    last = looks[-1]
    memory = [(look["uptime"] / 3600.0, look["memory"]) for look in looks]
    slope = growth(memory)
    grown = {what: more(what, looks) for what in ("descriptors", "threads")}

    print(
        f"daemon: {last['uptime'] / 60:.1f} min on wires beside {arguments.busy} busy processes,"
        f" {arguments.part:g} min a part, memory {last['memory']:.1f} MB, {slope:+.2f} MB/h,"
        f" {last['descriptors']} descriptors, {last['threads']} threads, real time: "
        f"{last['real_time']},"
        f" load average {np.median([look['load'] for look in looks]):.1f} (median)"
    )
    print(
        "lost on the wires: "
        f"{json.dumps({name: device['lost'] for name, device in last['devices'].items()})}"
    )

    for name in ("late_50", "late_99", "late_999", "late_max"):
        worst = [1e3 * look["loop"][name] for look in looks]
        print(f"{name} of 10 s [ms]: median {np.median(worst):.3f}, worst {max(worst):.3f}")
    print("\n".join(line for line in words if line.startswith(("queue:", "loop:", "log "))))

    wrong = leak(memory) if arguments.minutes >= 30.0 else []
    wrong += [f"{by} {what} more than at the start" for what, by in grown.items() if by > 0]
    return wrong + ["the log was not closed"] * (
        not any(line.startswith("log closed") for line in words)
    )


def more(what: str, looks: Sequence[dict[str, Any]]) -> int:
    """How many more there are in the last third than in the one after settling; a file being synced
    counts twice.
    """
    third = len(looks) // 3
    return int(min(look[what] for look in looks[-third:])) - int(
        min(look[what] for look in looks[third : 2 * third])
    )


if __name__ == "__main__":
    sys.exit(guarded(main))
