"""Diagnoses of every verdict, made up from formulas: what a report has to cope with, without
running the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gritd.tools.diagnose.explain.result import (
    Diagnosis,
    Fit,
    Hypothesis,
    Law,
    Location,
    NextExperiment,
    Quantity,
    Scatter,
    SoilFit,
    Test,
    Trace,
)

LOADS = (40.0, 55.0, 70.0, 85.0, 100.0, 120.0)
SIGMA = {"torque": 0.012, "drawbar_pull": 0.18, "sinkage": 6e-5}
UNITS = {"torque": "N·m", "drawbar_pull": "N", "sinkage": "m"}
CONFIGURATION = "testbed: single-wheel testbed\nwheel:\n  radius: 72 mm\n  width: 71 mm\n"

STANDSTILL = "stand still for some seconds with the drive powered"


def traces(
    missing: Callable[[np.ndarray, np.ndarray], np.ndarray] | None,
    loads: tuple[float, ...],
    channels: tuple[str, ...],
) -> tuple[Trace, ...]:
    """Runs of 28 s at 5 Hz with five slips; `missing`(time, slip) adds to the torque what the model
    left out.
    """
    rng, found = np.random.default_rng(4), []
    time = np.arange(140) / 5.0
    slip = np.repeat([0.1, 0.2, 0.3, 0.45, 0.6], 28)
    still = (time < 1.0) | (time > 27.0)

    for load in loads:
        full = {
            "torque": 0.036 * load * (1.0 - np.exp(-6.0 * slip)),
            "drawbar_pull": load * (0.35 * (1.0 - np.exp(-5.0 * slip)) - 0.08),
            "sinkage": 1e-4 * load**0.9 * (1.0 + 0.3 * slip),
        }
        for channel in channels:
            after = np.where(still, 0.0, full[channel])
            truth = after + (
                missing(time, slip) * ~still if missing and channel == "torque" else 0.0
            )
            before = after + (0.35 * (truth - after).mean() if missing else 0.0)
            noise = SIGMA[channel] * rng.standard_normal(time.size)
            found.append(
                Trace(
                    f"{load:g} N",
                    channel,
                    UNITS[channel],
                    time.tolist(),
                    (truth + noise).tolist(),
                    before.tolist(),
                    (truth if missing else before).tolist(),
                    (~still).astype(int).tolist(),
                    SIGMA[channel],
                )
            )

    return tuple(found)


def scatter(of: tuple[Trace, ...]) -> Scatter:
    slip = np.repeat([0.1, 0.2, 0.3, 0.45, 0.6], 28) + 0.004 * np.sin(np.arange(140))
    chosen = [t for t in of if t.channel == "torque"]
    used = np.asarray(chosen[0].used, bool)
    residual = {
        kind: np.concatenate(
            [(np.array(t.measured) - np.array(getattr(t, kind)))[used] for t in chosen]
        )
        for kind in ("before", "after")
    }

    return Scatter(
        "torque",
        "slip",
        "N·m",
        "-",
        np.tile(slip[used], len(chosen)).tolist(),
        residual["before"].tolist(),
        residual["after"].tolist(),
        np.repeat(np.arange(len(chosen)), used.sum()).tolist(),
        SIGMA["torque"],
    )


def soil(after_c: float, sigma: float, moved: float) -> SoilFit:
    prior = {
        "c": Quantity(1000.0, 300.0, "Pa"),
        "tan_phi": Quantity(0.577, 0.06, "-"),
        "k": Quantity(0.025, 0.0025, "m"),
        "n": Quantity(1.1, 0.011, "-"),
        "K": Quantity(1.536e6, 7.68e4, "Pa/m^n"),
    }
    after = {
        "c": Quantity(after_c, sigma, "Pa"),
        "tan_phi": Quantity(0.571, 0.008, "-"),
        "k": Quantity(0.0246, 0.0004, "m"),
        "n": Quantity(1.098, 0.006, "-"),
        "K": Quantity(1.55e6, 2.1e4, "Pa/m^n"),
    }
    before = after | {"c": Quantity(after_c + moved, sigma, "Pa")} if moved else after

    return SoilFit(
        prior, before, after, {"c": moved / 300.0, "tan_phi": 0.1, "k": -0.2, "n": 0.0, "K": 0.2}
    )


def fit(
    before: float, *, innovations: bool = False, channels: tuple[str, ...] = tuple(SIGMA)
) -> Fit:
    """Torque errs by `before` times its noise without the explanation."""
    return Fit(
        {c: UNITS[c] for c in channels},
        {c: SIGMA[c] * (before if c == "torque" else 1.1) for c in channels},
        {c: SIGMA[c] * 1.05 for c in channels},
        {c: SIGMA[c] for c in channels},
        {"torque": 4.2, "drawbar_pull": 1.3} if innovations else None,
        {"torque": 1.1, "drawbar_pull": 1.0} if innovations else None,
    )


def base(**changed: object) -> Diagnosis:
    """Consistent."""
    plain = traces(None, LOADS, tuple(SIGMA))
    made = Diagnosis(
        verdict="consistent",
        summary=(
            "The recordings agree with the model: the largest evidence of a mismatch is 0.8 "
            "nats, and noise alone exceeds it in 41 % of cases."
        ),
        test=Test("omnibus", 0.8, 4.6, 0.41, 0.01, 400),
        location=(),
        hypotheses=(),
        soil=soil(1020.0, 60.0, 0.0),
        fit=fit(1.05),
        law=None,
        next_experiment=None,
        caveats=("The configuration states n more exactly than any soil is known.",),
        remaining_words="Nothing remains above the noise floor",
        nuisance={
            "sinkage_offset": Quantity(4e-5, 6e-5, "m"),
            "torque_scale": Quantity(0.004, 0.0015, ""),
        },
        noise={c: {"sigma": s, "correlation": 0.2, "configured": s} for c, s in SIGMA.items()},
        baseline=("stress_linearisation",),
        traces=plain,
        scatters=(),
        redo={
            "command": ["gritd", "diagnose", "run1.mcap", "run2.mcap", "--config", "testbed.yaml"],
            "files": [{"file": f"run{i}.mcap", "sha256": f"{i}" * 64} for i in (1, 2)],
            "configuration": CONFIGURATION,
            "seed": 1,
            "versions": {"gritd": "0.1.0", "numpy": "1.26.4"},
        },
    )
    return replace(made, **changed)  # type: ignore[arg-type]


def consistent() -> Diagnosis:
    return base()


def explained() -> Diagnosis:
    """One effect, with a rival that the recordings cannot tell from it."""
    drawn = traces(lambda time, slip: 0.13 + 0.1 * slip, LOADS, tuple(SIGMA))

    return base(
        verdict="explained",
        summary=(
            "The motor consumes 0.13 N·m more than the soil takes, at every load (Coulomb "
            "friction, 86 %): the torque error on held-out runs falls from 0.11 to 0.013 N·m, "
            "and c from 1710 to 1020 Pa."
        ),
        test=Test("coulomb_friction", 213.0, 4.8, 1.0 / 401.0, 0.01, 400),
        location=(
            Location(
                "torque",
                "constant",
                0.81,
                0.0025,
                0.01,
                "torque is 0.13 N·m too large at every slip and load",
            ),
            Location(
                "torque", "slip", 0.14, 0.004, 0.03, "torque grows by 0.06 N·m from 10 to 60 % slip"
            ),
            Location("torque", "time", 0.02, 0.01, 0.05, "torque rises late in the runs", (12.4,)),
        ),
        hypotheses=(
            Hypothesis(
                "coulomb_friction",
                0.86,
                208.0,
                {"loss": Quantity(0.131, 0.006, "N·m")},
                ("current_offset",),
                True,
                "Motor, gear and bearings consume a constant torque while the wheel turns.",
                "T_loss = T_C sign(ω)",
                separated_by={"current_offset": STANDSTILL},
            ),
            Hypothesis(
                "current_offset",
                0.12,
                205.9,
                {"offset": Quantity(0.065, 0.003, "A")},
                ("coulomb_friction",),
                False,
                "The shunt amplifier reads a current where there is none.",
                separated_by={"coulomb_friction": STANDSTILL},
            ),
            Hypothesis(
                "viscous_friction", 0.015, 190.0, {"damping": Quantity(0.4, 0.1, "N·m·s/rad")}
            ),
            Hypothesis("rear_contact", 0.004, 40.0, {"ratio": Quantity(0.1, 0.05)}),
            Hypothesis("grousers", 0.001, 12.0, {"height": Quantity(0.002, 0.001, "m")}),
        ),
        soil=soil(1020.0, 60.0, 690.0),
        fit=fit(9.2, innovations=True),
        next_experiment=NextExperiment(
            "standstill",
            STANDSTILL,
            ("coulomb_friction", "current_offset"),
            11.0,
        ),
        traces=drawn,
        scatters=(scatter(drawn),),
    )


def several() -> Diagnosis:
    """Two accepted effects, far more runs than fit a page."""
    drawn = traces(
        lambda time, slip: 0.1 + 0.004 * time,
        tuple(40.0 + 5.0 * i for i in range(11)),
        tuple(SIGMA),
    )
    first, second, *rest = explained().hypotheses
    sizes = {"cohesion_change": Quantity(0.4, 0.05), "centre": Quantity(0.61, 0.02, "m")}
    patch = Hypothesis(
        "soil_patch",
        0.97,
        31.0,
        sizes,
        (),
        True,
        "On one stretch of the bed the soil has another cohesion or friction angle.",
    )

    return replace(
        explained(),
        hypotheses=(first, patch, second, *rest),
        traces=drawn,
        scatters=(scatter(drawn),),
    )


def unlisted() -> Diagnosis:
    drawn = traces(lambda time, slip: 0.4 * slip**2, LOADS, tuple(SIGMA))
    hypotheses = tuple(
        replace(h, probability=p, accepted=False, indistinguishable_from=())
        for h, p in zip(explained().hypotheses, (0.2, 0.1, 0.05, 0.01, 0.0), strict=True)
    )

    return base(
        verdict="unlisted",
        summary=(
            "Torque exceeds the model by up to 0.14 N·m at high slip; no listed effect explains "
            "it (best: Coulomb friction, 20 %). A fitted law takes 88 % of it."
        ),
        test=Test("torque~slip", 96.0, 4.8, 1.0 / 401.0, 0.01, 400),
        location=(
            Location(
                "torque",
                "slip",
                0.9,
                0.0025,
                0.005,
                "torque exceeds the model by 0.14 N·m at 60 % slip",
            ),
        ),
        hypotheses=hypotheses,
        soil=soil(1090.0, 90.0, 300.0),
        fit=fit(6.0),
        law=Law(
            "torque",
            "0.40 N·m · i²",
            {"slip": (0.1, 0.6), "speed": (0.02, 0.02)},
            0.88,
            MappingProxyType({"torque_slip_squared": Quantity(0.4, 0.02, "N·m")}),
        ),
        remaining_words="Replicates differ by less than the law leaves: "
        "0.02 N·m remain above the noise floor",
        traces=drawn,
        scatters=(scatter(drawn),),
    )


def insufficient() -> Diagnosis:
    """One short run, no force sensor: most things are unknown."""
    one = traces(None, (70.0,), ("torque", "sinkage"))

    return base(
        verdict="insufficient",
        summary=(
            "One run at one load cannot tell whether anything is missing: an effect of 0.1 N·m "
            "would not show."
        ),
        test=Test("strain", 3.9, 4.4, 0.02, 0.01, 400),
        soil=None,
        fit=Fit({}, {}, {}, {}),
        next_experiment=NextExperiment(
            "load_step", "repeat at a lighter and a heavier load", (), 8.0
        ),
        noise={"torque": {"sigma": 0.012, "correlation": float("nan")}},
        traces=one,
        redo={},
    )


def hostile() -> Diagnosis:
    """Names and notes that try to be markup, and numbers that are none."""
    evil = '<script>alert(1)</script>"><img src=x onerror=alert(2)>&\x00\udcff\u202e' + "W" * 300
    bad = float("nan")
    first = explained()
    best, *others = first.hypotheses
    files = [{"file": evil, "sha256": evil}]

    return replace(
        first,
        summary=evil,
        location=(Location("torque", "slip", bad, bad, bad, evil, (bad,)), *first.location),
        hypotheses=(replace(best, sentence=evil, separated_by={"current_offset": evil}), *others),
        fit=Fit({"torque": "N·m"}, {"torque": bad}, {"torque": bad}, {"torque": bad}),
        caveats=(evil,),
        remaining_words=evil,
        law=Law("torque", evil, {evil: (0.0, bad)}, bad, {evil: Quantity(bad, bad, evil)}),
        traces=tuple(
            replace(t, run=evil, measured=[bad] * len(t.time), sigma=bad) for t in first.traces[:4]
        ),
        redo={"command": evil, "files": files, evil: evil, "configuration": evil + "\n" + evil},
    )


ALL = {f.__name__: f for f in (consistent, explained, several, unlisted, insufficient, hostile)}
