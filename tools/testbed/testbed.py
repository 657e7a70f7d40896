"""The simulated testbed: a process of its own that plays a run of the wheel on real wires, in real
time.

    python -m gritd.tools.testbed.testbed --folder F

writes F/testbed.yaml, which tells a daemon where the wires are, and the truth beside it; then it
plays: encoders over a pseudo-terminal, the other sensors over CAN, every reading at the time it
would arrive.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config import effects
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.daemon.scheduling import real_time
from gritd.estimator.messages.readings import Reading
from gritd.estimator.terramechanics.soil import Soil
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.command import DONE, Parser, number, whole
from gritd.tools.cli.guard import guarded
from gritd.tools.testbed import plant, rig_config, run_files
from gritd.tools.testbed.plant import PlantKind
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.sensors import START
from gritd.tools.testbed.simulation import SimulatedRun
from gritd.tools.testbed.wires import CanKind, ConnectedDevices

NS = 1_000_000_000
JITTER = 0.2e-3  # [s] mean delay on the way, beyond the constant one
LONGEST_JITTER = 3e-3  # [s]
TOGETHER = 100_000  # [ns] readings due this soon are sent without another sleep
LEAD = 50_000_000  # [ns] from the start of the play to its first reading
SHORTEST = 5.0  # [s]
NAME = "testbed"  # of the truth files
PLAYED = "testbed.played.json"


@dataclass(frozen=True)
class Experiment:
    """All that is decided before the first byte is sent."""

    configuration: Configuration
    soil: Soil
    run: SimulatedRun
    plant: PlantKind
    seed: int


@dataclass(frozen=True)
class Played:
    """How punctual the wires were [s]: quantiles of sent minus due, and what nobody took, by
    device.
    """

    late_half: float
    late_most: float
    late_worst: float
    readings: int
    lost: dict[str, int]


def experiment(
    configuration: Configuration, seconds: float, kind: PlantKind, seed: int
) -> Experiment:
    """A soil drawn away from the configured one, a schedule of this length, and the readings it
    gives.
    """
    settings = configuration.settings
    soil = plant.drawn_soil(settings, np.random.default_rng(seed))
    motion = motion_of(plant.schedule(seconds), settings.wheel.radius, settings.rates.tick)

    return Experiment(
        configuration, soil, plant.drive(kind, settings, soil, motion, seed + 1), kind, seed
    )


def in_transit(readings: Iterable[Reading], seed: int) -> list[Reading]:
    """The readings with random delays on the way, in the order of arrival, stamps and arrivals from
    zero [ns].
    """
    sent = list(readings)
    rng = np.random.default_rng(seed)
    delays = np.minimum(rng.exponential(JITTER, len(sent)), LONGEST_JITTER) * NS
    zero = START

    moved = [
        Reading(r.stamp - zero, r.channel, r.value, r.received - zero + int(delay))
        for r, delay in zip(sent, delays, strict=True)
    ]
    return sorted(moved, key=lambda reading: reading.received)


def play(
    readings: Sequence[Reading], rig: ConnectedDevices, stopped: Callable[[], bool] = lambda: False
) -> Played:
    """Send every reading when it is due, `received` [ns] after the start; returns after the last,
    or when stopped.
    """
    start = time.monotonic_ns() + LEAD
    late = []

    for reading in readings:
        due = start + reading.received
        left = due - time.monotonic_ns()
        if left > TOGETHER:
            if stopped():
                break
            time.sleep(left / NS)
        rig.send(reading)
        late.append(time.monotonic_ns() - due)

    half, most = np.quantile(late, (0.5, 0.99)) / NS if late else (0.0, 0.0)
    return Played(float(half), float(most), max(late, default=0) / NS, len(late), rig.lost)


def main(argv: Sequence[str] | None = None) -> int:
    """Play one run; exit 0 at its end or when told to stop. Raises ConfigError or OSError."""
    arguments = _parser().parse_args(argv)
    folder: Path = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)

    configuration = config.load(arguments.config)
    prepared = experiment(configuration, arguments.seconds, arguments.plant, arguments.seed)
    write_truth(folder, prepared)

    with ConnectedDevices(configuration.settings, arguments.can) as rig:
        print(
            "configuration "
            f"{rig_config.write(configuration, rig.devices, arguments.plant, folder)}",
            flush=True,
        )

        if not arguments.wait or sys.stdin.readline():
            stop = _stop_on_signals()
            # a real rig is not held up by the computer's other work; where refused, it may be
            real_time()
            played = play(in_transit(prepared.run.readings, arguments.seed + 2), rig, stop.is_set)
            (folder / PLAYED).write_text(
                json.dumps(asdict(played), indent=2) + "\n", encoding="utf-8"
            )

    return DONE


def write_truth(folder: Path, prepared: Experiment) -> None:
    """testbed.truth.json and testbed.truth.npz, as `gritd simulate` writes them."""
    settings = prepared.configuration.settings
    acting = effects.configured(settings.effects)
    run_files.write_truth(
        folder / NAME, settings, prepared.soil, acting, prepared.run, prepared.seed
    )


def _stop_on_signals() -> StopRequest:
    """Set by SIGTERM and SIGINT."""
    stop = StopRequest()
    for ending in (signal.SIGTERM, signal.SIGINT):
        signal.signal(ending, lambda *_: stop.set())
    return stop


def add_play(parser: argparse.ArgumentParser) -> None:
    """The options that say what is played, also `gritd demo`'s."""
    parser.add_argument(
        "--seconds",
        type=number(low=SHORTEST),
        default=60.0,
        metavar="S",
        help="length of the run, default 60",
    )
    parser.add_argument("--seed", type=whole(0), default=1, help="of soil and noise; default 1")

    parser.add_argument(
        "--plant",
        choices=get_args(PlantKind),
        default="original",
        help="Eqs. 1-10 (default), or the closed forms",
    )
    parser.add_argument(
        "--can",
        choices=get_args(CanKind),
        default="auto",
        help="slcan where the computer has no multicast",
    )


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="python -m gritd.tools.testbed.testbed",
        description="Play a simulated run on a pseudo-terminal and on CAN.",
    )
    parser.add_argument(
        "--folder", type=Path, required=True, metavar="F", help="where configuration and truth go"
    )
    parser.add_argument(
        "--config", default=packaged(), help="the testbed; default: the packaged testbed.yaml"
    )
    add_play(parser)
    parser.add_argument(
        "--wait", action="store_true", help="play when a line comes on standard input"
    )

    return parser


if __name__ == "__main__":
    sys.exit(guarded(main))
