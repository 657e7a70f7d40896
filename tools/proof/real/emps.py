"""EMPS: a motor drive without soil, its friction concealed by not being in the model that the
diagnosis starts from.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from gritd.estimator.config import configuration as config
from gritd.estimator.recording import salvage
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.proof.real.bench import CommandBench, DiagnosisRun
from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Panel, Proof, listed

PUBLISHED = {"M": (95.11, "kg"), "Fv": (203.5, "N·s/m"), "Fc": (20.39, "N")}
WITHIN = 0.03
RATE, EVERY = 1000.0, 20  # [Hz] of the logs; samples in one of the judge's
POSITION, COMPARED = 100.0, 20.0  # [Hz] cut-offs of the judge's low-passes
FAST = 0.035  # [m/s] above which a second regression is made
SPAN = (2.0, 9.0)  # [s] that are drawn


def _run(bench: CommandBench) -> Finding:
    folder = bench.imported("emps", "emps", files=["emps"])
    diagnosis = bench.diagnosis([folder / "data-emps.mcap"], folder / "emps.yaml", "emps-data")
    fitted, unseen = (_regression(folder / f"data-emps{name}.mcap") for name in ("", "-pulses"))

    bare = np.append(
        np.linalg.lstsq(fitted.columns[:, :2], fitted.force, rcond=None)[0], (0.0, 0.0)
    )
    identified = stated(diagnosis)

    rows = [
        (
            name,
            *(f"{c:.2f}" for c in model),
            f"{fitted.error(model):.2%}",
            f"{unseen.error(model):.2%}",
        )
        for name, model in (
            ("inertia and viscous friction", bare),
            ("with what was found", identified),
            ("the judge's least squares", fitted.solved(0.0)),
            (f"the same above {FAST * 1e3:g} mm/s", fitted.solved(FAST)),
        )
    ]
    rows.append(("published", *(f"{v:.2f}" for v, _ in PUBLISHED.values()), "", "", ""))

    heads = (
        "model",
        "M [kg]",
        "Fv [N·s/m]",
        "Fc [N]",
        "offset [N]",
        "error, DATA_EMPS",
        "error, DATA_EMPS_PULSES",
    )

    shown = (unseen.time >= SPAN[0]) & (unseen.time <= SPAN[1])
    curves = np.stack(
        (unseen.time, unseen.force, unseen.columns @ bare, unseen.columns @ identified)
    )[:, shown]
    labels = ("measured", "inertia and viscous friction", "with what was found")

    panel = Panel(
        "DATA_EMPS_PULSES, which the diagnosis did not see", curves, "time [s]", "force [N]", labels
    )

    checks = _checks(diagnosis, identified, unseen.error(bare), unseen.error(identified))
    return Finding([diagnosis], checks, FigureTable(heads, rows), [panel])


@dataclass(frozen=True)
class Regression:
    """Force (n,) and what it may be made of (n, 4): acceleration, speed, its sign, one; all through
    one low-pass.
    """

    time: Array
    columns: Array
    force: Array

    def error(self, model: Array) -> float:
        """Relative error of the force by a model (4,), as the benchmark has it."""
        return float(np.linalg.norm(self.force - self.columns @ model) / np.linalg.norm(self.force))

    def solved(self, slowest: float) -> Array:
        """Least squares (4,) over speeds [m/s] above the slowest."""
        kept = np.abs(self.columns[:, 1]) >= slowest
        return np.asarray(np.linalg.lstsq(self.columns[kept], self.force[kept], rcond=None)[0])


def _regression(path: Path) -> Regression:
    recording = salvage.read(path)
    settings = config.loads(recording.config_yaml or "", path.name).settings

    counts, volts = (recording.arrays(f"/raw/{name}") for name in ("wheel_encoder", "motor_shunt"))
    count = settings.channels["wheel_encoder"].calibration.scale.value
    position = _low_passed(counts["count"] * count, POSITION)
    speed = np.gradient(position, 1.0 / RATE)

    columns = np.column_stack(
        (np.gradient(speed, 1.0 / RATE), speed, np.sign(speed), np.ones_like(speed))
    )

    force = volts["volts"] * settings.drive.torque_constant.value
    kept = slice(None, None, EVERY)

    return Regression(
        (counts["stamp"][kept] - counts["stamp"][0]) * 1e-9,
        _low_passed(columns, COMPARED)[kept],
        _low_passed(force, COMPARED)[kept],
    )


def _low_passed(values: Array, cutoff: float) -> Array:
    return np.asarray(sosfiltfilt(butter(4, cutoff, output="sos", fs=RATE), values, axis=0))


def stated(diagnosis: DiagnosisRun) -> Array:
    """Mass, viscous friction, Coulomb friction and offset (4,) that the diagnosis states; 0 where
    it states none.
    """
    gain = config.loads(
        diagnosis.result["redo"]["configuration"], "emps.yaml"
    ).settings.drive.torque_constant.value

    constants = diagnosis.result["nuisance"]
    asymmetry = diagnosis.values("asymmetric_friction").get("difference", 0.0)
    offset = gain * diagnosis.values("current_offset").get("offset", 0.0)
    coulomb = diagnosis.values("coulomb_friction").get("loss", 0.0)

    return np.array(
        [constants["inertia"]["value"], constants["damping"]["value"], coulomb, asymmetry + offset]
    )


def _checks(diagnosis: DiagnosisRun, identified: Array, before: float, after: float) -> list[Check]:
    first = (
        diagnosis.result["hypotheses"][0]["effect"] if diagnosis.result["hypotheses"] else "nothing"
    )
    group = listed(sorted(diagnosis.group)) or "nothing"
    remains = diagnosis.result["remaining_words"]

    checks = [
        Check(
            "Which friction does it name first?",
            "coulomb_friction",
            first,
            first == "coulomb_friction",
        ),
        Check(
            "Does it name the asymmetry, or a group that holds it?",
            "asymmetric_friction",
            group,
            "asymmetric_friction" in diagnosis.group,
            "The drive never stands in this log, so an offset of the voltage is the same thing.",
        ),
    ]

    for (name, (value, unit)), estimate in zip(
        PUBLISHED.items(), identified.tolist(), strict=False
    ):
        off = estimate / value - 1.0
        shown = f"{estimate:.2f} {unit} ({off:+.1%})"
        checks.append(
            Check(f"{name}?", f"{value} {unit} ± {WITHIN:.0%}", shown, abs(off) <= WITHIN, REASON)
        )

    checks.append(
        Check(
            "Does it say that something remains?", "yes", remains, not remains.startswith("Nothing")
        )
    )

    question = "Is the force of the unseen log predicted better?"
    errors = f"{before:.2%} before, {after:.2%} after"
    checks.append(Check(question, "error more than halved", errors, after < 0.5 * before))

    return checks


REASON = """
What remains is friction that is no straight line in speed. Without the lowest speeds the judge's
own least squares moves from the published values by as much (see the table). So the weight that an
estimator gives to reversals decides.
"""

FRICTION = Proof(
    name="emps",
    rig="emps",
    title="EMPS, friction concealed",
    concealed="""
        A linear drive with friction, a public identification benchmark (Janot, Gautier, Brunot
        2019). The diagnosis starts without a friction but the viscous. Mass, viscous and
        Coulomb friction as published with the data judge; so does DATA_EMPS_PULSES, which the
        diagnosis does not see, by a regression of the judge's own (another filter, grid and
        derivative).
    """,
    saw="""
        Position and control voltage of DATA_EMPS, and the gain from voltage to force. Neither mass
        nor friction.
    """,
    run=_run,
)
