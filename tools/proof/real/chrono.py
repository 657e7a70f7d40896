"""Project Chrono's SCM terrain: a simulator that nobody here wrote. Its base campaign is the
reference; lugs, a patch, or nothing is new.
"""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import numpy as np

from gritd.tools.proof.real.bench import CommandBench, DiagnosisRun
from gritd.tools.proof.real.judge import Judge
from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Panel, Proof, listed

RUNS = 6
COHESION, TAN_PHI = 1000.0, 0.577  # [Pa], [-] of the simulator
LUGS = 15
PATCH = 0.45  # [m] from where torque and pull of the imitated patch are larger
FACTORS = {"T": 1.10, "DP": 1.20}
SIGMAS = 2.0
SHOWN = 2  # the run that is drawn
CHANNELS = {
    "torque": ("torque [N·m]", 1.0),
    "drawbar_pull": ("drawbar pull [N]", 1.0),
    "sinkage": ("sinkage [mm]", 1e3),
}
LABELS = ("lugs, as simulated", "as configured", "with what --apply wrote")


def _run(bench: CommandBench) -> Finding:
    folder = bench.imported("chrono", "chrono", files=["chrono"])
    base = [folder / f"base-{n}.mcap" for n in range(RUNS)]
    lugs = [folder / f"lugs-{n}.mcap" for n in range(RUNS)]
    patch = _patched(bench)
    configuration = folder / "chrono.yaml"

    nothing = bench.diagnosis(base[4:], configuration, "chrono-base", reference=base[:4])
    lugged = bench.diagnosis(lugs, configuration, "chrono-lugs", reference=base)
    patched = bench.diagnosis(patch, configuration, "chrono-patch", reference=base)

    diagnoses = [nothing, lugged, patched]
    applied = bench.folder / "chrono-lugs.yaml"
    panels = _panels(lugs[SHOWN], configuration, applied)
    return Finding(diagnoses, _checks(nothing, lugged, patched), _table(diagnoses), panels)


def _patched(bench: CommandBench) -> list[Path]:
    """Recordings of the base campaign with more torque and pull beyond a place of the bed."""
    raw = bench.folder / "patch-logs"
    raw.mkdir()
    for number in range(RUNS):
        source = bench.data / "chrono" / f"base_{number}.csv.gz"
        with (
            gzip.open(source, "rt", newline="") as read,
            gzip.open(raw / f"patch_{number}.csv.gz", "wt", newline="") as write,
        ):
            rows = csv.DictReader(read)
            out = csv.DictWriter(write, rows.fieldnames or ())
            out.writeheader()
            out.writerows(_stronger(row) for row in rows)

    folder = bench.imported("chrono", "patch", files=[str(raw)])
    return [folder / f"patch-{number}.mcap" for number in range(RUNS)]


def _stronger(row: dict[str, str]) -> dict[str, str]:
    if float(row["x"]) <= PATCH:
        return row
    return row | {name: f"{factor * float(row[name]):.6g}" for name, factor in FACTORS.items()}


def _panels(recording: Path, configuration: Path, applied: Path) -> list[Panel]:
    """Each channel of a run with lugs over time."""
    judge = Judge([recording], configuration)
    before, after = judge.predicted()[0], Judge([recording], applied).predicted()[0]
    panels = []
    for channel, (label, factor) in CHANNELS.items():
        series = (judge.measured(0, channel), before[channel], after[channel])
        curves = np.stack([judge.time(0), *(factor * values for values in series)])
        panels.append(Panel(label, curves, "time [s]", label, LABELS))
    return panels


def _table(diagnoses: list[DiagnosisRun]) -> FigureTable:
    news = ("nothing", f"{LUGS} lugs of 4 mm", "torque +10 %, pull +20 % beyond 0.45 m")
    rows = []
    for new, diagnosis in zip(news, diagnoses, strict=True):
        names = [f"{n} {h['probability']:.2f}" for n, h in diagnosis.accepted.items()]
        soil = (_stated(diagnosis, name) for name in ("c", "tan_phi"))
        rows.append([new, diagnosis.result["verdict"], listed(names) or "none", *soil])
    return FigureTable(("new", "verdict", "names", "c [Pa]", "tan φ"), rows)


def _stated(diagnosis: DiagnosisRun, name: str) -> str:
    after = diagnosis.result["soil"]["after"][name]
    digits = 0 if name == "c" else 3
    return f"{after['value']:.{digits}f} ± {after['sigma']:.{digits}f}"


def _checks(nothing: DiagnosisRun, lugs: DiagnosisRun, patch: DiagnosisRun) -> list[Check]:
    count = lugs.values("grousers").get("count", float("nan"))
    beside = [name for name in lugs.accepted if name != "grousers"]
    verdict, first = nothing.result["verdict"], _first(lugs)
    of_patch = listed(patch.accepted) or patch.result["verdict"]
    calm = ("consistent", "insufficient")

    return [
        Check("Is nothing called new where nothing is?", "consistent", verdict, verdict in calm),
        Check("Lugs: what does it name first?", "grousers", first, first == "grousers"),
        Check("How many lugs?", f"{LUGS}", f"{count:.2f}", abs(count - LUGS) < 0.5),
        Check("What else does it name?", "nothing", listed(beside) or "nothing", not beside, WHY),
        _soil(lugs, "c", COHESION),
        _soil(lugs, "tan_phi", TAN_PHI),
        Check(
            "A patch: what does it name?",
            "soil_patch",
            of_patch,
            of_patch == "soil_patch",
            WHY_PATCH,
        ),
    ]


def _first(diagnosis: DiagnosisRun) -> str:
    return next(iter(diagnosis.accepted), str(diagnosis.result["verdict"]))


def _soil(diagnosis: DiagnosisRun, name: str, true: float) -> Check:
    after = diagnosis.result["soil"]["after"][name]
    near = abs(after["value"] - true) <= SIGMAS * after["sigma"]
    words = {"c": "cohesion", "tan_phi": "tan φ"}[name]
    return Check(f"Is the {words} within two sigma?", f"{true:g}", _stated(diagnosis, name), near)


WHY = """
The lugs dig in over 0.1 m of travel, and deeper with slip. That is a part of what they do, but the
form of `grousers` allows less of it: what is named with them says the rest.
"""

WHY_PATCH = """
`soil_patch` takes all of the misfit, and is far likelier than any other effect. But its form is
40 % off: the imitation adds 10 % of the torque and 20 % of the pull, which no soil does.
"""

TERRAIN = Proof(
    name="chrono",
    rig="chrono",
    title="Project Chrono, lugs and a patch",
    concealed="""
        What is new on a wheel of Project Chrono's SCM terrain since its base campaign: nothing, 15
        lugs of 4 mm, or a patch (torque 10 % and drawbar pull 20 % larger beyond 0.45 m, an
        imitation made from the base campaign). Cohesion and tan φ of the simulator judge.
    """,
    saw="""
        The base campaign of six runs as reference, of four where two of its runs are the new
        campaign; motion and forces, read by the packaged testbed's sensors with their noise; the
        packaged configuration, which states the simulator's soil within its uncertainty.
    """,
    run=_run,
)
