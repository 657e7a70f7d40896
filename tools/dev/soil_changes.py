"""Is σ honest when the soil changes under the wheel? Random steps, ramps and patches, and hours
without a change.

python -m gritd.tools.dev.soil_changes [--cases 200] [--hours 20] [--seed 1] [--plant original]

Every case draws its soil, its calibration errors (within their stated sigma), its loads and slips
and the change: c by up to ±20 %, tan φ by up to ±6 %, at once, over 20 s, or on a patch of the bed.
The testbed obeys the original equations, its sensors have their stated noise; the filter is that of
the live loop, fed one window after another.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.estimate import KPA, TAN_PHI, C
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.filter.tuning import CHANGE, TRUST
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.status import UPDATED, Flag
from gritd.estimator.offline.batch import window_ends
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import RecordedStreams, Stream
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.estimator.wheel.sync import Snapshot
from gritd.tools.cli.command import DONE, CommandError, Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.progress import Progress
from gritd.tools.testbed import plant
from gritd.tools.testbed.drawn_rig import drawn, drawn_rig
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.sensors import START, TRANSPORT, Sent, sent
from gritd.tools.testbed.simulation import soil_of

Kind = Literal["step", "ramp", "patch", "none"]
KINDS: tuple[Kind, ...] = ("step", "ramp", "patch")

RATE = 250.0  # [Hz] readings of every channel
BEFORE, AFTER = 60.0, 70.0  # [s] of driving before a change begins, at the least, and after
UNCHANGED = 600.0  # [s] of a run without a change
RAMP = 20.0  # [s]
EDGE = 0.01  # [m] of a patch
C_CHANGE, TAN_PHI_CHANGE = 0.20, 0.06  # largest, relative
TOLD = Flag.MISMATCH | Flag.RESET | Flag.CHANGED | Flag.PRIOR
BACK, STAYS = 15.0, 5.0  # [s] in which σ is to hold again, and for how long at least


@dataclass(frozen=True)
class Case:
    """One run: the true soil over time, the windows the sensors give, and when the soil changes."""

    kind: Kind
    varied: bool  # whether the load varies
    settings: Settings  # of the filter
    snapshots: list[Snapshot]
    cohesion: Array  # true [Pa], one a window
    tan_phi: Array  # true, one a window
    begins: float  # [s] of the change
    settled: float  # [s] from which on the soil is the same again


class Course(NamedTuple):
    """What the filter made of a case, one row a window that was used, each (n,)."""

    time: Array  # [s]
    error: Array  # (n, 2) of c [Pa] and tan φ
    sigma: Array  # (n, 2)
    nees: Array  # normalised error squared of the pair, 2 when honest
    told: NDArray[np.bool_]  # whether a flag warns of the estimate

    @property
    def away(self) -> Array:
        """Error of c or of tan φ, whichever is the larger in its σ."""
        worst: Array = np.max(np.abs(self.error) / self.sigma, axis=1)
        return worst


# --- cases ----------------------------------------------------------------------------------------


def packaged_rig() -> Settings:
    """The packaged testbed at ten ticks a second."""
    settings = config.load(packaged()).settings
    assert settings.wrench is not None
    channels = {name: replace(each, stale_after=1.0) for name, each in settings.channels.items()}
    return replace(
        settings,
        channels=channels,
        wrench=replace(settings.wrench, stale_after=1.0),
        rates=replace(settings.rates, tick=settings.rates.update),
        filter=replace(settings.filter, engine="plain"),
    )


def case(
    settings: Settings, kind: Kind, seed: int, of: plant.PlantKind = "original", rate: float = RATE
) -> Case:
    """The case of a seed: the load varies in every other one, a quarter has no force/torque
    sensor.
    """
    rng = np.random.default_rng((seed, ["step", "ramp", "patch", "none"].index(kind)))
    varied = seed % 2 == 0
    if seed % 4 == 1:
        settings = replace(settings, wrench=None)
    seconds = UNCHANGED if kind == "none" else BEFORE + 10.0 + AFTER
    motion = motion_of(_schedule(rng, seconds, varied), settings.wheel.radius, rate)
    begins = BEFORE + rng.uniform(0.0, 10.0)
    share, settled = _change(kind, motion, begins, rng)
    soil = _changed(_soil(settings, rng), share, rng)
    if of == "linear":
        settings = replace(settings, effects=())
    rig, driven = drawn_rig(settings, rng), motion
    if settings.wrench is None:
        settings, driven = _weighed(settings, motion, rng)
    response = plant.respond(of, settings, soil, driven)
    seen = _windows(settings, sent(rig, driven, response, rng))
    at = (np.array([snapshot.evaluated for snapshot in seen]) - START) / NS
    time = np.asarray(motion.time)
    c, tan_phi = (np.interp(at, time, values) for values in (soil.cohesion, soil.tan_phi))
    return Case(kind, varied, settings, seen, c, tan_phi, begins, settled)


def _weighed(
    settings: Settings, motion: Motion, rng: np.random.Generator
) -> tuple[Settings, Motion]:
    """Without a force/torque sensor: the load is what the weights say, and off by its sigma."""
    load = replace(settings.load.nominal, value=float(np.asarray(motion.load)[0]))
    stated = replace(settings, load=replace(settings.load, nominal=load))
    return stated, replace(motion, load=motion.load + drawn(load, rng).value - load.value)


def _schedule(rng: np.random.Generator, seconds: float, varied: bool) -> Schedule:
    """Conditions of 3 to 8 s; one load or several, slips from 3 to 60 %."""
    load, segments, left = rng.uniform(35.0, 100.0), [Segment(1.5, 60.0, 0.2, 0.0)], seconds
    while left > 0.0:
        duration = rng.uniform(3.0, 8.0)
        load = rng.uniform(35.0, 100.0) if varied else load
        slip, speed = rng.uniform(0.03, 0.6), rng.uniform(0.018, 0.03)
        segments.append(Segment(duration, load, slip, speed))
        left -= duration
    segments[0] = replace(segments[0], load=segments[1].load)
    return Schedule(tuple(segments), plant.RAMP)


def _soil(settings: Settings, rng: np.random.Generator) -> Soil:
    """A soil drawn from the stated prior."""
    c, tan_phi, k = settings.soil.cohesion, settings.soil.tan_phi, settings.soil.shear_modulus
    values = {
        "cohesion": max(drawn(c, rng).value, 0.1 * c.value),
        "tan_phi": drawn(tan_phi, rng).value,
        "shear_modulus": max(drawn(k, rng).value, 0.5 * k.value),
    }
    return soil_of(settings, values)


def _change(
    kind: Kind, motion: Motion, begins: float, rng: np.random.Generator
) -> tuple[Array, float]:
    """How much of the change the wheel feels at every sample, 0 to 1, and when the last of it is
    over [s].
    """
    time, place = np.asarray(motion.time), np.asarray(motion.carriage_position)
    if kind == "none":
        return np.zeros(time.size), float(time[-1])
    if kind == "step":
        return np.where(time >= begins, 1.0, 0.0), begins
    if kind == "ramp":
        return np.clip((time - begins) / RAMP, 0.0, 1.0), begins + RAMP
    start = float(np.interp(begins, time, place))
    end = start + rng.uniform(0.15, 0.5)
    share = 0.5 * (np.tanh((place - start) / EDGE) - np.tanh((place - end) / EDGE))
    return share, float(np.interp(end, place, time))


def _changed(soil: Soil, share: Array, rng: np.random.Generator) -> Soil:
    c = soil.cohesion * (1.0 + rng.uniform(-C_CHANGE, C_CHANGE) * share)
    tan_phi = soil.tan_phi * (1.0 + rng.uniform(-TAN_PHI_CHANGE, TAN_PHI_CHANGE) * share)
    return replace(soil, cohesion=c, tan_phi=tan_phi)


def _windows(settings: Settings, channels: Mapping[str, Sent]) -> list[Snapshot]:
    """What the loop's windows see of what the channels send."""
    last = min(int(each.stamps[-1]) for each in channels.values())
    ticks = np.arange(START, last, round(NS / settings.rates.tick))
    streams = {
        name: Stream(
            each.stamps,
            each.stamps + TRANSPORT,
            np.searchsorted(ticks, each.stamps + TRANSPORT),
            each.values,
        )
        for name, each in channels.items()
    }
    ends = window_ends(ticks, round(NS / settings.rates.update))
    return list(snapshots(settings, RecordedStreams(ticks, streams), ends))


# --- what the filter makes of them ----------------------------------------------------------------


def followed(case: Case) -> Course:
    """The filter over a case."""
    tracker = Tracker(case.settings)
    state, rows = tracker.start(), []
    for number, snapshot in enumerate(case.snapshots):
        state, account = tracker.step(state, snapshot)
        if account.status not in UPDATED:
            continue
        estimate = account.estimate
        covariance = np.array(estimate.P)[: TAN_PHI + 1, : TAN_PHI + 1]
        error = np.array(
            (
                estimate.x[C] - case.cohesion[number] / KPA,
                estimate.x[TAN_PHI] - case.tan_phi[number],
            )
        )
        rows.append(
            (
                (snapshot.evaluated - case.snapshots[0].evaluated) / NS,
                error,
                np.sqrt(np.diag(covariance)),
                error @ np.linalg.solve(covariance, error),
                bool(account.flags & TOLD),
            )
        )
    return Course(*(np.array(column) for column in zip(*rows, strict=True)))


class Verdict(NamedTuple):
    """One case in figures; times in s of driving."""

    driven: float  # after the change began
    beyond: float  # of it, beyond 3σ without a flag
    far: float  # of it, beyond 5σ without a flag
    told: float  # of it, with a flag
    back: float  # from the end of the change until 2σ holds; inf where it never does
    nees: float  # at the end


def judged(case: Case, course: Course) -> Verdict:
    """How honest σ was from the change on."""
    step = 1.0 / case.settings.rates.update
    after = course.time >= case.begins
    silent = after & ~course.told
    return Verdict(
        driven=step * float(np.sum(after)),
        beyond=step * float(np.sum(silent & (course.away > 3.0))),
        far=step * float(np.sum(silent & (course.away > 5.0))),
        told=step * float(np.sum(after & course.told)),
        back=_back(course, case.settled, step),
        nees=float(course.nees[-1]),
    )


def _back(course: Course, settled: float, step: float) -> float:
    """Driving time from `settled` until error ≤ 2σ has begun to hold for some seconds."""
    inside = course.away[course.time >= settled] <= 2.0
    stays = round(STAYS / step)
    if inside.size < stays:
        return float("inf")
    held = np.convolve(inside, np.ones(stays, int), "valid") == stays
    return step * float(np.argmax(held)) if held.any() else float("inf")


def begun(course: Course) -> int:
    """How often a flag went up."""
    return int(np.sum(np.diff(course.told.astype(int), prepend=0) > 0))


# --- tables ---------------------------------------------------------------------------------------


def verdicts(
    settings: Settings, seeds: Sequence[int], of: plant.PlantKind, rate: float
) -> Iterator[tuple[Case, Verdict]]:
    """Every seed as one of the kinds in turn."""
    for seed in seeds:
        each = case(settings, KINDS[(seed // 4) % len(KINDS)], seed, of, rate)
        yield each, judged(each, followed(each))


def table(found: Sequence[tuple[Case, Verdict]]) -> str:
    """One line a kind, and one for all."""
    head = (
        f"{'change':18}{'cases':>6}{'beyond 3σ':>11}{'beyond 5σ':>11}{'flagged':>9}"
        f"{'2σ in 15 s':>12}{'median':>9}{'90 %':>8}{'NEES':>7}"
    )
    groups: list[tuple[str, list[Verdict]]] = [
        (f"{kind}, {'loads vary' if varied else 'one load'}", kept)
        for kind in KINDS
        for varied in (True, False)
        if (kept := [v for c, v in found if (c.kind, c.varied) == (kind, varied)])
    ]
    groups.append(("all", [verdict for _, verdict in found]))
    return "\n".join([head, *(_line(name, group) for name, group in groups)])


def _line(name: str, group: Sequence[Verdict]) -> str:
    total = sum(v.driven for v in group)
    back = np.array([v.back for v in group])
    return (
        f"{name:18}{len(group):6}{sum(v.beyond for v in group) / total:11.2%}"
        f"{sum(v.far for v in group) / total:11.2%}{sum(v.told for v in group) / total:9.1%}"
        f"{np.mean(back <= BACK):12.0%}{np.median(back):7.1f} s"
        f"{np.quantile(back, 0.9, method='nearest'):6.1f} s{np.mean([v.nees for v in group]):7.2f}"
    )


def unchanged(
    settings: Settings, seeds: Sequence[int], of: plant.PlantKind, rate: float
) -> Iterator[tuple[Case, Course]]:
    for seed in seeds:
        each = case(settings, "none", seed, of, rate)
        yield each, followed(each)


def quiet(courses: Sequence[Course]) -> str:
    """False flags and honesty of runs without a change."""
    hours = len(courses) * UNCHANGED / 3600.0
    flags = [begun(course) for course in courses]
    beyond = np.concatenate([(course.away > 3.0) & ~course.told for course in courses])
    within = np.concatenate([course.away <= 2.0 for course in courses])
    nees = [course.nees[-1] for course in courses]
    sigma_c, sigma_t = np.median([course.sigma[-1] for course in courses], axis=0)
    return (
        f"unchanged, {hours:.1f} h: {sum(flags)} flags in {sum(f > 0 for f in flags)} of"
        f" {len(courses)} runs, {sum(flags) / hours:.2f} an hour; beyond 3σ without a flag"
        f" {beyond.mean():.2%} of the time, within 2σ {within.mean():.1%};"
        f" NEES {np.mean(nees):.2f} of 2; median σ at the end {sigma_c * KPA:.0f} Pa,"
        f" {sigma_t:.4f}"
    )


# --- command --------------------------------------------------------------------------------------


def set_number(text: str) -> None:
    """NAME=VALUE into the filter's tuned numbers, for this experiment.

    Raises CommandError where there is none of that name.
    """
    name, _, value = text.partition("=")
    for tuning in (CHANGE, TRUST):
        if name in {field.name for field in fields(tuning)}:
            # frozen for everybody else
            object.__setattr__(tuning, name, float(value))
            return
    raise CommandError(f"--number {name}: found no such number in estimator/filter/tuning.py")


def main(argv: Sequence[str] | None = None) -> int:
    """Print both tables. Exit 0."""
    arguments = _parser().parse_args(argv)
    for text in arguments.number:
        set_number(text)
    settings, first = packaged_rig(), arguments.seed * 100_000
    drives = (arguments.plant, arguments.rate)

    with Progress("changes", arguments.cases) as progress:
        found = []
        for each in verdicts(settings, range(first, first + arguments.cases), *drives):
            found.append(each)
            progress.advance()
    if found:
        print(table(found), flush=True)

    runs = round(arguments.hours * 3600.0 / UNCHANGED)
    with Progress("runs without a change", runs) as progress:
        courses = []
        for _, course in unchanged(settings, range(first, first + runs), *drives):
            courses.append(course)
            progress.advance()
    if courses:
        print(quiet(courses))
    return DONE


def _parser() -> Parser:
    parser = Parser(
        prog="python -m gritd.tools.dev.soil_changes",
        description="Random changes of the soil, and hours without: is σ honest?",
    )
    parser.add_argument("--cases", type=int, default=200, help="with a change; default 200")
    parser.add_argument("--hours", type=float, default=20.0, help="without one; default 20")
    parser.add_argument("--seed", type=int, default=1, help="of the first case; default 1")
    parser.add_argument("--plant", choices=("original", "linear"), default="original")
    parser.add_argument("--rate", type=float, default=RATE, help="readings a second; default 250")
    parser.add_argument(
        "--number",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="another value of a tuned number (estimator/filter/tuning.py)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(guarded(main))
