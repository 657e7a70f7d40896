"""What a tick, a replay, a force, a filter update, a message and a start cost on this machine, and
what others take for the same.

Everything is measured in one run on one seeded, simulated recording. Times are processor time, so
that what other programs take meanwhile is not counted; they still slow the caches, so the ratios
are what to compare between runs.
"""

from __future__ import annotations

import gc
import statistics
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import process_time

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import STATES
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.batch import estimates
from gritd.estimator.offline.playback import recorded_ticks
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import STREAMS, recorded_streams
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.tables import Fields
from gritd.estimator.recording.topics import RAW_TOPICS, TOPICS, messages_of
from gritd.estimator.terramechanics import linear, original, scalar
from gritd.tools.bench import against, diagnosis, peers
from gritd.tools.bench import forward as forward_bench
from gritd.tools.bench.live import at_rate, live
from gritd.tools.bench.start import start
from gritd.tools.cli.progress import Progress
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import SimulatedRun, simulate_run, soil_of

SEED = 2005
RIM_SPEED = 0.02  # [m/s]
FAST = 1000.0  # [Hz] of all sensors and of the loop
LEVELS = [(load, slip) for load in (40.0, 70.0, 100.0) for slip in (0.1, 0.2, 0.3, 0.45, 0.6)]

Figures = dict[str, float]


@dataclass(frozen=True)
class BenchSizes:
    """How much of everything; the defaults take about two minutes."""

    seconds: float = 60.0  # of recording
    ticks: int = 5000
    repeats: int = 7
    samples: int = 2000  # forces in a batch
    starts: int = 3  # of a process, for each engine
    simulated: float = 60.0  # [s] for the forward model
    live: float = 60.0  # [s] of the daemon on simulated wires
    fast: float = 0.0  # [s] of the daemon at FAST; 0 for none
    long: float = 0.0  # [s] of a recording with ticks that is replayed whole; 0 for none
    runs: tuple[int, ...] = ()  # that are diagnosed together
    lengths: tuple[float, ...] = ()  # [s] of runs that are diagnosed alone


# what takes minutes
LONG = BenchSizes(fast=60.0, long=3600.0, runs=diagnosis.RUNS, lengths=diagnosis.LENGTHS)


@dataclass(frozen=True)
class Subject:
    """What is measured on."""

    sizes: BenchSizes
    configuration: config.Configuration
    run: SimulatedRun
    path: Path  # of its recording, raw topics only
    logged: Path  # the same run with what the ticks said

    def repeated(self, run: Callable[[], object]) -> list[float]:
        """Processor time of each repetition [s]."""
        return [_timed(run) for _ in range(self.sizes.repeats)]


def measure(sizes: BenchSizes, folder: Path) -> dict[str, Figures]:
    """All figures by section, SI: times in s, speeds as multiples of real time."""
    sections: dict[str, Callable[[Subject], Figures]] = {
        "tick": tick,
        "replay": replay,
        "forces": forces,
        "update": update,
        "recording": recording,
        "reading": lambda subject: against.reading(subject.logged, subject.sizes.repeats),
        "writing": lambda subject: against.writing(subject.logged, subject.sizes.repeats),
        "start": lambda subject: start(subject.sizes.starts),
        "live": lambda subject: live(subject.sizes.live, folder / "live"),
        "reading_live": lambda subject: against.reading(
            next((folder / "live").glob("*.mcap")), subject.sizes.repeats
        ),
        "forward_model": forward_model,
    }
    if sizes.fast:
        sections["live_at_1_khz"] = lambda subject: live(
            sizes.fast, folder / "fast", at_rate(FAST, folder / "fast-rig")
        )
    if sizes.long:
        sections["long_replay"] = lambda subject: long_replay(sizes, folder)
    if sizes.runs and sizes.lengths:
        sections["diagnosis"] = lambda subject: diagnosis.diagnosis(
            folder, sizes.runs, sizes.lengths
        )

    with Progress("measuring", len(sections) + 1) as progress:
        subject = _subject(sizes, folder)
        progress.advance()
        figures = {}
        for name, section in sections.items():
            figures[name] = section(subject)
            progress.advance()

    return figures


def _subject(sizes: BenchSizes, folder: Path) -> Subject:
    """The packaged testbed over three loads and five slips."""
    configuration = config.load(packaged())
    settings = configuration.settings
    each = sizes.seconds / len(LEVELS)
    schedule = Schedule(
        tuple(Segment(each, load, slip, RIM_SPEED) for load, slip in LEVELS), min(0.5, each / 4.0)
    )

    motion = motion_of(schedule, settings.wheel.radius, settings.rates.tick)
    run = simulate_run(settings, soil_of(settings), motion, (), SEED)
    subject = Subject(
        sizes, configuration, run, folder / "bench.mcap", folder / "bench-with-ticks.mcap"
    )

    _write(subject, subject.path)
    _write_ticks(subject)
    return subject


# --- the sections ---


def tick(subject: Subject) -> Figures:
    """Cost of one tick of the live loop, with the heap frozen as the daemon has it, to the worst;
    and how often the median tick could be made in the time of a plain loop of known cost.
    """
    settings = subject.configuration.settings
    pipeline = Pipeline(settings)
    ticks = list(recorded_ticks(read(subject.path), settings.rates.tick))[: subject.sizes.ticks]
    state, spent = pipeline.start(), []

    gc.collect()
    gc.freeze()

    try:
        for each in ticks:
            start = process_time()
            state, _ = pipeline.step(state, each.readings, each.stamp)
            spent.append(process_time() - start)
    finally:
        gc.unfreeze()

    middle, most, nearly = np.quantile(spent, (0.5, 0.99, 0.999)).tolist()
    loop = statistics.median(subject.repeated(_plain_loop))
    return {
        "median": middle,
        "at_99_percent": most,
        "at_99.9_percent": nearly,
        "worst": max(spent),
        "share_of_budget": most * settings.rates.tick,
        "plain_loop": loop,
        "over_plain_loop": loop / middle,
        "plain_loop_over_worst_ratio": loop / max(spent),
    }


def replay(subject: Subject) -> Figures:
    """From the file to the estimates of every window, as multiples of real time, of raw topics by
    each engine and of a recording with ticks; by turns.
    """

    def run(path: Path, engine: str) -> None:
        estimates(subject.configuration.settings, read(path, tables=STREAMS), engine)

    kinds = {engine: (subject.path, engine) for engine in ENGINES}
    kinds["with_ticks"] = (subject.logged, "plain")
    spent = against.by_turns(
        {kind: partial(run, *given) for kind, given in kinds.items()}, subject.sizes.repeats
    )
    seconds = subject.sizes.seconds
    return {
        f"{kind}_speed": seconds / statistics.median(times) for kind, times in spent.items()
    } | {f"{kind}_best": seconds / min(times) for kind, times in spent.items()}


def long_replay(sizes: BenchSizes, folder: Path) -> Figures:
    """A long recording with ticks: what of its replay is reading and what is the filter's [s], and
    the whole as a multiple of real time.
    """
    place = folder / "long"
    place.mkdir()
    subject = _subject(replace(sizes, seconds=sizes.long), place)

    begun = process_time()
    recording = read(subject.logged, tables=STREAMS)
    read_by = process_time()
    rows = estimates(subject.configuration.settings, recording)
    spent, done = process_time() - begun, sizes.long

    return {
        "seconds": done,
        "windows": len(rows),
        "reading": read_by - begun,
        "filter": spent - (read_by - begun),
        "speed": done / spent,
        "bytes": subject.logged.stat().st_size,
    }


def forces(subject: Subject) -> Figures:
    """Closed forms (20)-(22) against quadrature of (8)-(10): one sample, gradients included, and
    one of a batch.
    """
    settings, samples = subject.configuration.settings, subject.sizes.samples
    wheel, ground = settings.wheel, soil_of(settings)
    rng = np.random.default_rng(SEED)
    theta_1, slip = rng.uniform(0.2, 1.0, samples), rng.uniform(0.05, 0.8, samples)
    known = (float(ground.cohesion), float(ground.tan_phi), float(ground.shear_modulus))
    some = list(zip(theta_1[:200].tolist(), slip[:200].tolist(), strict=True))

    def per_call(run: Callable[[float, float], object]) -> float:
        return statistics.median(subject.repeated(lambda: [run(*at) for at in some])) / len(some)

    def per_sample(run: Callable[[], object]) -> float:
        return statistics.median(subject.repeated(run)) / samples

    closed = per_call(lambda t, i: scalar.predict(wheel, *known, t, i, 70.0))
    quadrature = per_call(lambda t, i: original.forces(wheel, ground, t, i))
    closed_batch = per_sample(
        lambda: linear.forces_under_load(wheel, *known, theta_1, slip, 70.0, maths=linear.ARRAYS)
    )
    quadrature_batch = per_sample(lambda: original.forces(wheel, ground, theta_1, slip))
    return {
        "closed_form": closed,
        "quadrature": quadrature,
        "ratio": quadrature / closed,
        "closed_form_in_batch": closed_batch,
        "quadrature_in_batch": quadrature_batch,
        "ratio_in_batch": quadrature_batch / closed_batch,
    }


def update(subject: Subject) -> Figures:
    """One measurement of torque and drawbar pull applied by each engine."""
    settings = subject.configuration.settings
    tracker = Tracker(settings)
    whole = recorded_streams(read(subject.path), settings.rates.tick)
    state = tracker.start()
    for snapshot in snapshots(
        settings, whole, np.arange(25, 101, 25)
    ):  # into the first steady stretch
        state, account = tracker.step(state, snapshot)
    estimate, measurement = state.estimate, tracker.measurement
    offered = measurement.linearise(
        account.now, measurement.predict(estimate, account.now), estimate, state.by_parameters
    )

    def cost(engine: str) -> float:
        apply = make_engine(engine).update
        return (
            statistics.median(
                subject.repeated(lambda: [apply(estimate, offered) for _ in range(200)])
            )
            / 200
        )

    costs = {engine: cost(engine) for engine in ENGINES}
    alone = peers.filterpy_alone(estimate, offered)
    alone_cost = statistics.median(subject.repeated(lambda: [alone() for _ in range(200)])) / 200
    return {
        **costs,
        "ratio": costs["filterpy"] / costs["plain"],
        "filterpy_alone": alone_cost,
        "over_filterpy_alone": alone_cost / costs["plain"],
        "nuisances": len(estimate.x) - STATES,
    }


def recording(subject: Subject) -> Figures:
    """Cost of a message: written, read and checked, read as arrays, and read one by one."""
    count = len(subject.run.readings)
    copies = iter(range(subject.sizes.repeats))

    written = subject.repeated(
        lambda: _write(subject, subject.path.with_suffix(f".{next(copies)}.mcap"))
    )
    raw: dict[str, Fields] = {topic.name: None for topic in RAW_TOPICS}
    arrays = subject.repeated(lambda: read(subject.path, tables=raw).tables(raw))
    singly = subject.repeated(lambda: sum(1 for _ in read(subject.path).messages()))

    times = {"write": written, "read_as_arrays": arrays, "read_one_by_one": singly}
    return {name: statistics.median(spent) / count for name, spent in times.items()} | {
        "bytes": subject.path.stat().st_size / count
    }


def forward_model(subject: Subject) -> Figures:
    """The simulator, and its vertical balance against brentq on adaptive quadrature."""
    simulated = subject.sizes.simulated
    balance = forward_bench.balance_speed(subject.sizes.samples, SEED)

    return {
        "speed": forward_bench.simulated_seconds_per_second(simulated),
        "speed_with_six_effects": forward_bench.simulated_seconds_per_second(
            simulated, forward_bench.ONE_OF_EACH
        ),
        "balance": balance.vectorised,
        "balance_by_brentq": balance.scalar,
        "balance_ratio": balance.ratio,
        "balance_by_brentq_on_8_nodes": balance.nodes,
        "balance_ratio_to_8_nodes": balance.nodes / balance.vectorised,
    }


def _write(subject: Subject, path: Path) -> None:
    writer = RunWriter(path, (), subject.configuration.text, RunInfo())
    for reading in subject.run.readings:
        writer.reading(reading)
    writer.close()


def _write_ticks(subject: Subject) -> None:
    """The run as the daemon logs it."""
    settings = subject.configuration.settings
    pipeline = Pipeline(settings)
    state = pipeline.start()

    writer = RunWriter(subject.logged, TOPICS, subject.configuration.text, RunInfo())
    for each in recorded_ticks(read(subject.path), settings.rates.tick):
        state, record = pipeline.step(state, each.readings, each.stamp)
        for reading in each.readings:
            writer.reading(reading)
        for message in messages_of(record):
            writer.message(*message)

    writer.close()


def _plain_loop() -> float:
    """Twenty thousand products and sums of floats: what this interpreter does in that time."""
    total = 0.0
    for number in range(20_000):
        total += 0.5 * number
    return total


def _timed(run: Callable[[], object]) -> float:
    start = process_time()
    run()
    return process_time() - start
