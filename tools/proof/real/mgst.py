"""MGST: what the drivetrain consumes, and what the side wall takes, of a wheel in GRC-1 simulant at
one speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.proof.real.bench import CommandBench, DiagnosisRun
from gritd.tools.proof.real.judge import Judge, rms
from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Panel, Proof, listed

BEGIN = (
    "--begin",
    "3",
)  # [s] from which the importer's own table takes means: the start is no steady driving
FOLDS = (
    (0, 3),
    (1, 4),
    (2, 5),
)  # a trial of 20 % and one of 70 % slip, judged by what the other four said
DRAWN = (0, 3)
LABELS = ("concealed", "as read", "freed, trial held out")
LOSS, LOSS_ABOUT = 1.8, 0.5  # [N·m] that the drivetrain takes, by the concealed sensor
WALL, WALL_ABOUT = 33.0, 8.0  # [N] that the side wall takes, by the authors' correction
STEADY_LOSSES = (
    "coulomb_friction",
    "viscous_friction",
    "current_offset",
    "asymmetric_friction",
    "stribeck_friction",
)
DRAGS = ("side_wall_rubbing", "bed_slope", "force_crosstalk")


@dataclass(frozen=True)
class HeldOutTrial:
    """One trial judged by a diagnosis that did not see it: concealed channel, as read, and freed of
    effects, (n,).
    """

    trial: str
    time: Array
    true: Array
    read: Array
    freed: Array

    @property
    def errors(self) -> tuple[float, float]:
        return rms(self.read - self.true), rms(self.freed - self.true)


@dataclass(frozen=True)
class Hidden:
    """What is hidden, how the importer hides it, and the channel that is freed and the one that
    judges it.
    """

    name: str
    arguments: tuple[str, ...]
    read: str
    true: str
    unit: str
    ask: Callable[[DiagnosisRun, Sequence[HeldOutTrial]], list[Check]]


def _run(hidden: Hidden, bench: CommandBench) -> Finding:
    seen = bench.imported("mgst", hidden.name, *hidden.arguments, *BEGIN, files=["mgst"])
    whole = bench.imported("mgst", "judge", *BEGIN, files=["mgst"])
    trials = sorted(seen.glob("*.mcap"))
    diagnosis = bench.diagnosis(trials, seen / "mgst.yaml", f"{hidden.name}-all")

    held = sorted(
        (h for fold in FOLDS for h in _held(hidden, bench, trials, fold, whole)),
        key=lambda h: h.trial,
    )

    rows = [
        (
            h.trial,
            *(f"{np.nanmean(v):.2f}" for v in (h.true, h.read, h.freed)),
            *(f"{e:.2f}" for e in h.errors),
        )
        for h in held
    ]

    heads = (
        "trial",
        f"concealed [{hidden.unit}]",
        "as read",
        "freed",
        "error before",
        "error after",
    )

    label = f"{hidden.read.replace('_', ' ')} [{hidden.unit}]"
    panels = [
        Panel(h.trial, np.stack((h.time, h.true, h.read, h.freed)), "time [s]", label, LABELS)
        for h in (held[n] for n in DRAWN)
    ]

    return Finding([diagnosis], hidden.ask(diagnosis, held), FigureTable(heads, rows), panels)


def _held(
    hidden: Hidden, bench: CommandBench, trials: Sequence[Path], fold: Sequence[int], whole: Path
) -> list[HeldOutTrial]:
    configuration = trials[0].parent / "mgst.yaml"
    others = [t for n, t in enumerate(trials) if n not in fold]

    diagnosis = bench.diagnosis(
        others, configuration, f"{hidden.name}-without-{'-'.join(str(n + 1) for n in fold)}"
    )

    here = [trials[n] for n in fold]
    reads, judge = (
        Judge(here, configuration),
        Judge([whole / t.name for t in here], whole / "mgst.yaml"),
    )

    freed = reads.freed(diagnosis.result, hidden.read)

    return [
        HeldOutTrial(
            t.stem,
            judge.time(n),
            judge.measured(n, hidden.true),
            reads.measured(n, hidden.read),
            freed[n],
        )
        for n, t in enumerate(here)
    ]


def _differs(diagnosis: DiagnosisRun, channel: str) -> Check:
    channels = dict.fromkeys(place["channel"] for place in diagnosis.result["location"])
    return Check(
        f"Is {channel} among the channels that differ?",
        channel,
        listed(channels),
        channel in channels,
    )


def _names(diagnosis: DiagnosisRun, what: str, wanted: Sequence[str], reason: str) -> Check:
    answer = listed(diagnosis.accepted) or diagnosis.result["verdict"]
    question = f"Does it name {what}, or a group that holds one?"
    return Check(
        question, f"one of {listed(wanted)}", answer, bool(diagnosis.group & set(wanted)), reason
    )


def _nearer(diagnosis: DiagnosisRun, held: Sequence[HeldOutTrial], unit: str, reason: str) -> Check:
    before, after = (rms(np.array(e)) for e in zip(*(h.errors for h in held), strict=True))
    better = sum(h.errors[1] < h.errors[0] for h in held)

    return Check(
        "Is the freed channel nearer to the concealed one, on trials that were held out?",
        f"in all {len(held)}, error more than halved",
        f"in {better}; error {before:.2f} {unit} before, {after:.2f} after",
        better == len(held) and after < 0.5 * before,
        reason,
    )


# --- the drivetrain ---

SPEED, TORQUE, CONSTANT = (
    0.462,
    7.9,
    6.2,
)  # [rad/s]; [N·m] of the motor, between 20 and 70 % slip; [N·m/A]
Values = Mapping[str, float]
LOST: Mapping[
    str, Callable[[Values], float]
] = {  # [N·m] that an effect takes at this speed and torque
    "coulomb_friction": lambda p: p["loss"],
    "viscous_friction": lambda p: p["damping"] * SPEED,
    "current_offset": lambda p: p["offset"] * CONSTANT,
    "asymmetric_friction": lambda p: p["difference"],
    "stribeck_friction": lambda p: p["excess"] * float(np.exp(-((SPEED / p["speed"]) ** 2))),
    "torque_constant_error": lambda p: -p["error"] * TORQUE,
    "motor_heating": lambda p: p["fall"] * (TORQUE / CONSTANT) ** 2 * TORQUE,
}


def _of_drivetrain(diagnosis: DiagnosisRun, held: Sequence[HeldOutTrial]) -> list[Check]:
    loss = sum(LOST[n](diagnosis.values(n)) for n in diagnosis.accepted if n in LOST)
    answer = f"{loss:.2f} N·m" if loss else "none"

    return [
        _differs(diagnosis, "torque"),
        _names(
            diagnosis, "a torque loss that does not depend on speed", STEADY_LOSSES, REASON_LOSS
        ),
        Check(
            "How large is it?",
            f"{LOSS} ± {LOSS_ABOUT} N·m",
            answer,
            abs(loss - LOSS) <= LOSS_ABOUT,
            REASON_LOSS,
        ),
        _nearer(diagnosis, held, "N·m", REASON_LOSS),
    ]


REASON_LOSS = """
Motor torque alone does not tell a loss here. At one speed and one load, stronger soil, within what
is known of it, and the discrepancy of form give the same torques at both slips.
"""

DRIVETRAIN = Proof(
    name="mgst-drivetrain",
    rig="mgst",
    title="MGST, drivetrain concealed",
    concealed="""
        A smooth wheel in GRC-1 lunar simulant, three trials at 20 % and three at 70 % slip, all at
        one speed (Daca, Tremblay, Skonieczny 2023). The torque of the force/torque sensor, between
        drivetrain and wheel, is kept back and judges: in steady driving the motor's torque exceeds
        it by 1.7 to 2.2 N·m, which no soil equation contains.
    """,
    saw="""
        Wheel and carriage speed, motor current, sinkage since rest, load, drawbar pull, from 3 s
        on, when speeds are steady. Of soil and rig, what is published: GRC-1 as catalogued with
        wide sigmas, the torque constant to 5 %, the static sinkage to 8 mm. For the table the
        diagnosis is made three times more, from four trials each; its model then frees the other
        two trials' motor torque of what it found, the torque's calibration included.
    """,
    run=partial(
        _run,
        Hidden(
            "mgst-drivetrain",
            ("--conceal", "torque", "--conceal", "lateral_force"),
            "torque",
            "axle_torque",
            "N·m",
            _of_drivetrain,
        ),
    ),
)

# --- the side wall ---


def _of_wall(diagnosis: DiagnosisRun, held: Sequence[HeldOutTrial]) -> list[Check]:
    taken = float(np.mean([np.nanmean(h.freed - h.read) for h in held]))
    question = "How much drawbar pull does it say is taken, on trials that were held out?"

    return [
        _differs(diagnosis, "drawbar_pull"),
        _names(diagnosis, "the wall's drag", DRAGS, REASON_WALL),
        Check(
            question,
            f"{WALL:g} ± {WALL_ABOUT:g} N",
            f"{taken:.1f} N",
            abs(taken - WALL) <= WALL_ABOUT,
            REASON_WALL,
        ),
        _nearer(diagnosis, held, "N", REASON_WALL),
    ]


REASON_WALL = """
At one load a drag on the wall, a tilted bed and crosstalk of the load are one constant force.
Weaker soil, within what is known of it, and the discrepancy of form give the same pull at both
slips.
"""

SIDE_WALL = Proof(
    name="mgst-side-wall",
    rig="mgst",
    title="MGST, side wall concealed",
    concealed="""
        In the same trials the wheel rubs on the side wall of the bin, which takes about 33 N from
        the drawbar pull. The authors correct for it by a quarter of the lateral force. Correction
        and lateral force are kept back; the corrected drawbar pull judges.
    """,
    saw="""
        The drawbar pull as sensed and all other channels, the axle's torque among them, from 3 s
        on. Held-out trials as above.
    """,
    run=partial(
        _run,
        Hidden(
            "mgst-side-wall",
            ("--drawbar-pull", "raw", "--conceal", "lateral_force"),
            "drawbar_pull",
            "drawbar_pull",
            "N",
            _of_wall,
        ),
    ),
)
