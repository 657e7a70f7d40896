"""CMU: a wheel that is steered across its travel, handed over as one that goes straight."""

from __future__ import annotations

import numpy as np

from gritd.tools.proof.real.bench import CommandBench, DiagnosisRun
from gritd.tools.proof.real.cmu import DRIVEN, speeds_of
from gritd.tools.proof.real.judge import Judge, rms
from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Panel, Proof, listed

TABLE = ("cmu/smooth_all_trials_steady_state.csv",)
ANGLES = (15, 30, 45)  # [°]
SPEEDS = speeds_of(DRIVEN)


def _run(bench: CommandBench) -> Finding:
    straight = bench.imported("cmu", "straight", *SPEEDS, "--steering", "0", files=TABLE)
    usual = sorted((straight / "smooth-table").glob("*.mcap"))
    runs, panels, rows = [], [], []
    for angle in ANGLES:
        folder = bench.imported("cmu", f"at{angle}", *SPEEDS, "--steering", str(angle), files=TABLE)
        steered = sorted(folder.glob("*-table/*.mcap"))
        runs.append(bench.diagnosis(steered, straight / "cmu.yaml", f"at{angle}", usual))
        judge = Judge(steered, bench.folder / f"at{angle}.yaml")
        before = Judge(steered, straight / "cmu.yaml")
        curves = judge.means(
            "side_force",
            judge.covariate("slip"),
            [run.measured["side_force"] for run in judge.rig.runs],
            *([run["side_force"] for run in j.predicted()] for j in (before, judge)),
        )
        order = np.argsort(curves[0])
        labels = ("measured", "as if straight", "with what was found")
        title = f"side force at {angle}° [N]"
        _, measured, as_straight, found = curves
        errors = rms(as_straight - measured), rms(found - measured)
        rows.append((f"{angle}°", *(f"{error:.2f} N" for error in errors)))
        panels.append(Panel(title, curves[:, order], "slip [–]", title, labels, points=True))

    checks = [c for angle, run in zip(ANGLES, runs, strict=True) for c in _checks(angle, run)]
    heads = ("steered by", "error of the side force as if straight", "with what was found")
    return Finding(runs, checks, FigureTable(heads, rows), panels)


def _checks(angle: int, run: DiagnosisRun) -> list[Check]:
    named = listed(run.accepted) or run.result["verdict"]
    first = next(iter(run.accepted), "") == "side_slip"
    found = run.accepted.get("side_slip", {}).get("parameters", {}).get("angle")
    near = found is not None and abs(found["value"] - np.radians(angle)) < 2.0 * found["sigma"]
    return [
        Check(f"Which effect does it name first at {angle}°?", "side_slip", named, first),
        Check("And the angle?", f"{angle}° within 2σ", _angle(run), near, REASON),
    ]


def _angle(run: DiagnosisRun) -> str:
    found = run.accepted.get("side_slip", {}).get("parameters", {}).get("angle")
    if found is None:
        return "not said"
    return f"{np.degrees(found['value']):.0f} ± {np.degrees(found['sigma']):.0f}°"


REASON = """
Forces tell an angle by a law: by how far the soil yields sideways before it gives all of its
strength, and whether its stress has the direction of the displacement or of the sliding. Published
laws differ in both.
"""

STEERED = Proof(
    name="cmu-steered",
    rig="cmu",
    title="CMU, steering concealed",
    concealed=f"""
        The smooth wheel of the same testbed, turned by {listed(f"{a}°" for a in ANGLES)} from its
        travel. That it is turned is kept back; the angle judges.
    """,
    saw="""
        Steady states of the turned wheel, three repeats of five slips: motion, sinkage, load,
        drawbar pull, side force. Those of the wheel that goes straight are the reference.
    """,
    run=_run,
)
