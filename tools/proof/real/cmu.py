"""CMU: a grousered wheel handed over as the smooth one on which the soil was learnt."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.proof.real.bench import CommandBench, DiagnosisRun
from gritd.tools.proof.real.judge import Judge, rms
from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Panel, Proof, listed

DRIVEN = ("10", "12", "20", "40", "100")  # [mm/s] commanded rim speeds; the carriage has 10
FIT, HELD = ("10", "20", "100"), ("12", "40")
CHANNELS = {"drawbar_pull": ("drawbar pull [N]", 1.0), "sinkage": ("sinkage [mm]", 1e3)}
TABLES = (
    "cmu/smooth_all_trials_steady_state.csv",
    "cmu/grouser_first_trial_steady_state.csv",
    "cmu/penetration",
)
YIELDS = 0.0125e-3  # [m/N] of the frame, pressed on a rigid stop
DEPTH, FACTOR = (
    0.02,
    1.5,
)  # [m] at which the learnt modulus is compared with the plates', and how near it must be
PLATE, DEPTHS = (
    0.060,
    (4.0, 25.0),
)  # [m] plate nearest to the wheel's width; [mm] over which the moduli are fitted


def _run(bench: CommandBench) -> Finding:
    smooth = bench.imported("cmu", "cmu", *speeds_of(DRIVEN), files=TABLES)
    of_smooth = list((smooth / "smooth-table").glob("*.mcap"))
    first = bench.diagnosis(of_smooth, smooth / "cmu.yaml", "cmu-smooth")

    fit, held = (
        bench.imported("cmu", name, "--wheel", "grouser", *speeds_of(speeds), files=TABLES)
        / "grouser-table"
        for name, speeds in (("cmu-fit", FIT), ("cmu-held", HELD))
    )
    of_fit = list(fit.glob("*.mcap"))
    second = bench.diagnosis(of_fit, smooth / "cmu.yaml", "cmu-grouser", of_smooth)

    learnt = [bench.folder / f"cmu-{name}.yaml" for name in ("smooth", "grouser")]
    seen, unseen = (
        _conditions([Judge(sorted(f.glob("*.mcap")), path) for path in learnt]) for f in (fit, held)
    )

    rows = [
        (label, f"{speed} mm/s", *(f"{unseen[channel][i, k]:.2f}" for i in (1, 2, 3)))
        for channel, (label, _) in CHANNELS.items() for k, speed in enumerate(HELD)
    ]  # fmt: skip

    heads = ("held-out state", "rim speed", "measured", "as if smooth", "with what was found")
    labels = ("measured", "as if smooth", "with what was found; the states between were not seen")

    panels = [
        Panel(
            label, _sorted(np.hstack((seen[c], unseen[c]))), "slip [–]", label, labels, points=True
        )
        for c, (label, _) in CHANNELS.items()
    ]

    return Finding(
        [first, second],
        _checks(first, second, unseen, smooth / "penetration.csv"),
        FigureTable(heads, rows),
        panels,
    )


def speeds_of(speeds: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(a for speed in speeds for a in ("--rim-speed", speed))


def _conditions(judges: Sequence[Judge]) -> dict[str, Array]:
    """Slip, measured, predicted as if smooth, predicted with what was found: (4, conditions) of
    each channel. judges: with the configuration that `--apply` wrote of the smooth wheel, and with
    that of the other.
    """
    judge = judges[0]
    models: list[Sequence[Mapping[str, Array]]] = [[run.measured for run in judge.rig.runs]]
    models += [j.predicted() for j in judges]

    out = {}
    for channel, (_, factor) in CHANNELS.items():
        out[channel] = judge.means(
            channel, judge.covariate("slip"), *([run[channel] for run in m] for m in models)
        )
        out[channel][1:] *= factor

    return out


def _sorted(rows: Array) -> Array:
    return np.asarray(rows[:, np.argsort(rows[0])])


def moduli(path: Path) -> tuple[float, float]:
    """Exponent n and modulus [Pa/mⁿ] by least squares on the logarithms, the frame's yielding taken
    off the depth.
    """
    body = f"plate {PLATE * 1e3:.0f} mm"

    with path.open(encoding="utf-8") as stream:
        rows = [
            (float(r["depth_mm"]), float(r["force_N"]))
            for r in csv.DictReader(stream)
            if r["body"] == body
        ]

    depth, force = np.array(rows).T
    depth = depth - 1e3 * YIELDS * force
    inside = (depth > DEPTHS[0]) & (depth < DEPTHS[1])

    n, log_k = np.polyfit(
        np.log(depth[inside] * 1e-3), np.log(force[inside] / (np.pi * (0.5 * PLATE) ** 2)), 1
    )

    return float(n), float(np.exp(log_k))


def _checks(
    first: DiagnosisRun, second: DiagnosisRun, unseen: dict[str, Array], pressed: Path
) -> list[Check]:
    channels = dict.fromkeys(place["channel"] for place in second.result["location"])
    group = listed(sorted(second.group)) or second.result["verdict"]
    differ = "Do grip and sinking differ?"
    named = "Does it name grousers, or a group that holds them?"

    checks = [
        _of_modulus(first, pressed),
        Check(
            differ,
            "drawbar_pull, sinkage",
            listed(channels),
            set(CHANNELS) <= set(channels),
            REASON,
        ),
        Check(named, "grousers", group, "grousers" in second.group, REASON),
        _of_frame(first, second),
    ]

    for channel, (label, _) in CHANNELS.items():
        _, measured, before, after = unseen[channel]

        worse, better = rms(before - measured), rms(after - measured)
        question = f"Is the {label} of unseen states predicted better?"
        checks.append(
            Check(
                question,
                "error halved",
                f"{worse:.2f} before, {better:.2f} after",
                better < 0.5 * worse,
                REASON,
            )
        )

    return checks


def _of_modulus(first: DiagnosisRun, pressed: Path) -> Check:
    after, (n, modulus) = first.result["soil"]["after"], moduli(pressed)
    plate, wheel = modulus * DEPTH**n, after["K"]["value"] * DEPTH ** after["n"]["value"]
    return Check(
        f"Is the pressure of the soil learnt, {DEPTH * 1e3:.0f} mm deep, that under the plates?",
        f"{plate / 1e3:.0f} kPa (n {n:.2f}), within a factor of {FACTOR:g}",
        f"{wheel / 1e3:.0f} kPa (n {after['n']['value']:.2f})",
        1.0 / FACTOR < wheel / plate < FACTOR,
        REASON_MODULUS,
    )


def _of_frame(*diagnosis: DiagnosisRun) -> Check:
    values = [v["compliance"] for s in diagnosis if (v := s.values("frame_compliance"))]
    answer = f"{1e3 * max(values):.3f} mm/N" if values else "nothing said"
    return Check(
        "Is nothing said of the frame's yielding that the rigid stop denies?",
        f"at most {2e3 * YIELDS:.3f} mm/N, twice the stop's",
        answer,
        max(values, default=0.0) <= 2.0 * YIELDS,
    )


REASON_MODULUS = """
Steady states at one load tell one pressure, not a modulus: with slip-sinkage, exponent, datum and
modulus trade against each other within what is known of them (modulus ± 50 %, exponent ± 0.2), and
without torque the shear is not known either.
"""

REASON = """
Steady means hold no ripple, the one thing that only grousers make. What is left is sinkage that
grows with slip, as the lugs carry soil away, which another dependence on slip or speed describes as
well; and 1 to 3 N more pull, half of which cohesion and friction angle take up within what was
learnt of them on the smooth wheel.
"""

GROUSERS = Proof(
    name="cmu",
    rig="cmu",
    title="CMU, grousers concealed",
    concealed=f"""
        Two wheels in dry sand, one smooth, one with grousers of 5 mm (Pavlov and Johnson). That the
        second has grousers is kept back. Of its steady states the diagnosis sees those at rim
        speeds of {listed(FIT)} mm/s (the carriage has 10); those at {listed(HELD)} mm/s judge the
        prediction. The wheel pressed on a rigid stop judges what is said of the frame, the plates
        whether the soil that is learnt is still theirs.
    """,
    saw="""
        First the smooth wheel's steady states at 0 to 90 % slip, three repeats: motion, sinkage,
        load, drawbar pull, no torque. The configuration has the moduli of the plates pressed into
        the sand, as uncertain as plates of three sizes disagree. Then
        the other wheel's states, as if they were of the same wheel, with the smooth wheel's as
        reference. The judge predicts with what `--apply` wrote of each: effects, soil and
        discrepancy of form.
    """,
    run=_run,
)
