"""`python -m gritd.tools.proof.ours.trials`: the diagnosis on fresh cases of our own simulator,
scored against their truth.

Strengths are three to five times the detection limit (what is not listed, and must not be mimicked
by what is, eight to fifteen times): the strength whose whitened signature, soil and calibration
projected out, has a squared length of 16 (four standard deviations) in the drawn campaign. An
effect whose limit lies beyond three times its expected size cannot be seen in that campaign;
another campaign is drawn for it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.explain.explanation import explain
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.explain.wording import label
from gritd.tools.diagnose.fit import heldout
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.problem import free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import Search, search_models
from gritd.tools.diagnose.verdict.decide import decide
from gritd.tools.diagnose.verdict.decision import Decision
from gritd.tools.proof.ours.cases import LACKS, Plan, draw, record, rig_of, scaled
from gritd.tools.proof.ours.other_forms import COUSINS
from gritd.tools.proof.ours.score_table import table
from gritd.tools.proof.ours.unlisted import UNLISTED

LIMIT = 16.0  # squared length of a signature at the detection limit
# times the limit; what is not listed must show although a listed effect mimics it
STRONG, STRONGER = (3.0, 5.0), (8.0, 15.0)
LARGEST = 3.0  # expected sizes
DRAWS = 6  # campaigns tried for an effect
PAIRS = (
    ("coulomb_friction", "slip_sinkage"),
    ("bulldozing", "viscous_friction"),
    ("rear_contact", "current_offset"),
)
ORDER = (
    "none", "effect", "cousin", "unlisted", "effect", "pair",
    "none", "effect", "cousin", "unlisted", "effect", "cousin",
)  # fmt: skip
LISTED = tuple(n for n, e in EFFECTS.items() if not e.filter_only and n != "empirical_law")


@dataclass(frozen=True)
class Case:
    stratum: str  # none, effect, pair, unlisted
    truth: tuple[str, ...]
    seed: int
    strength: tuple[float, float] | None = None  # times the limit; the stratum's own if not given
    lack: str = ""  # what the campaign is without (cases.LACKS)


def cases(
    count: int,
    seed: int,
    only: Sequence[str] = (),
    strength: tuple[float, float] | None = None,
    lack: str = "",
) -> Iterator[Case]:
    """Strata in turn: a sixth without effect, effects, other forms, pairs, unlisted effects."""
    rng = np.random.default_rng(seed)

    for number in range(count):
        stratum = ORDER[number % len(ORDER)]
        truth: tuple[str, ...] = ()
        if stratum == "effect":
            truth = (LISTED[int(rng.integers(len(LISTED)))],)
        elif stratum == "unlisted":
            truth = (UNLISTED[int(rng.integers(len(UNLISTED)))].__name__,)
        elif stratum == "cousin":
            truth = (COUSINS[int(rng.integers(len(COUSINS)))].__name__,)
        elif stratum == "pair":
            truth = PAIRS[int(rng.integers(len(PAIRS)))]

        if only and stratum not in only and not set(only) & set(truth):
            continue
        yield Case(stratum, truth, int(rng.integers(1 << 31)), strength, lack)


def trial(case: Case) -> dict[str, Any]:
    """One case, from drawing to score; an error is a result too."""
    warnings.simplefilter("ignore", RuntimeWarning)
    began = time.perf_counter()
    try:
        scored = _trial(case)
    except Exception as error:
        scored = {"error": f"{type(error).__name__}: {error}", "trace": traceback.format_exc()}

    names = {c.__name__: c.stands_for for c in COUSINS}
    truth = [names.get(n, n) for n in case.truth]
    return {
        "stratum": case.stratum,
        "truth": truth,
        "form": list(case.truth),
        "seed": case.seed,
        **scored,
    } | {"seconds": time.perf_counter() - began}


def _trial(case: Case) -> dict[str, Any]:
    rng = np.random.default_rng(case.seed)
    settings = config.load(packaged()).settings
    own: dict[str, type[Effect]] = {t.__name__: t for t in (*UNLISTED, *COUSINS)}
    types = [EFFECTS.get(n) or own[n] for n in case.truth]
    drawn = _drawn(settings, types, case, rng)
    if drawn is None:
        return {"skipped": True}
    plan, acting = drawn

    rig = rig_of(plan, acting)
    noise = np.random.default_rng(0)
    search = search_models(prepare_screening(fit_base(rig, noise), noise))

    decision = decide(search)
    diagnosis = explain(search, decision, {"seed": 0})
    return (
        _scored(case, plan, acting, diagnosis)
        | _oracle(case, types, acting, search, diagnosis)
        | work(search, decision)
    )


def work(search: Search, decision: Decision) -> dict[str, Any]:
    """What the search weighed: to learn the calibration from, and to find the reason of a miss."""
    evidence = ((label(of), round(e, 1)) for of, e in search.first.evidence.items())

    return {
        "screen": dict(sorted(evidence, key=lambda i: -i[1])[:8]),
        "weighed": [
            {"names": list(w.names), "nameless": w.nameless, "evidence": round(w.evidence, 2)}
            for w in decision.weighed
        ],
        "candidates": len(search.problem.stack.rig.effects),
        "share": decision.share,
        "unlisted": decision.unlisted,
    }


def _drawn(
    settings: Any, types: list[type[Effect]], case: Case, rng: np.random.Generator
) -> tuple[Plan, list[Effect]] | None:
    for _ in range(DRAWS):
        plan = draw(settings, rng, case.lack)
        if not types:
            return plan, []

        base = fit_base(WheelRig(record(plan, ()), plan.settings), np.random.default_rng(0))
        span = case.strength or (STRONGER if types[0] in UNLISTED else STRONG)
        acting = [_strong(base, t, span, rng) for t in types]
        if all(a is not None for a in acting):
            return plan, [a for a in acting if a is not None]
    return None


def _strong(
    base: BaseFit, effect: type[Effect], span: tuple[float, float], rng: np.random.Generator
) -> Effect | None:
    """The effect at three to five times its detection limit in this campaign."""
    trial = scaled(effect, 0.5, rng)
    limit = _limit(base, trial)
    if limit is None:
        return None
    size = limit * float(np.exp(rng.uniform(*np.log(span))))
    if size > LARGEST:
        return None

    values = {
        p.name: float(np.clip(p.off + (getattr(trial, p.name) - p.off) * size / 0.5, p.low, p.high))
        for p in effect.parameters()
        if p.role == "strength"
    }
    return replace(trial, **values)


def _limit(base: BaseFit, at: Effect) -> float | None:
    """Size, in expected strengths, of which the projected signature has squared length LIMIT."""
    stack, fitted = base.problem.stack, base.fitted
    change = stack.predict(fitted.u, (at,)) - fitted.predicted
    if not np.isfinite(change).all() or not np.abs(change).any():
        return None
    column = base.problem.noise.whitener @ change[:, None]
    squared = float(fitted.projection().project(column)[0][0, 0])
    return 0.5 * float(np.sqrt(LIMIT / squared)) if squared > 1e-9 else None


def _scored(
    case: Case, plan: Plan, acting: Sequence[Effect], diagnosis: Diagnosis
) -> dict[str, Any]:
    true = {"c": float(np.mean(plan.soil.cohesion)), "tan_phi": float(np.mean(plan.soil.tan_phi))}
    soil = diagnosis.soil
    assert soil is not None

    return {
        "acting": [str(a) for a in acting],
        "verdict": diagnosis.verdict,
        "first": diagnosis.hypotheses[0].effect if diagnosis.hypotheses else None,
        "accepted": [h.effect for h in diagnosis.accepted],
        "groups": {h.effect: list(h.indistinguishable_from) for h in diagnosis.hypotheses},
        "ranking": [h.effect for h in diagnosis.hypotheses],
        "probability": {h.effect: h.probability for h in diagnosis.hypotheses},
        "p": diagnosis.test.p,
        "alarm": diagnosis.test.name,
        "statistic": diagnosis.test.statistic,
        "threshold": diagnosis.test.threshold,
        "soil": {
            n: [
                true[n],
                soil.before[n].value,
                soil.before[n].sigma,
                soil.after[n].value,
                soil.after[n].sigma,
            ]
            for n in true
        },
        "prior_sigma": {n: soil.prior[n].sigma for n in true},
        "channels": list(diagnosis.fit.unit),
        "slow": [plan.slow, plan.slow_time],
        "summary": diagnosis.summary,
        "remaining": diagnosis.remaining_words,
        "law": diagnosis.law.expression if diagnosis.law else None,
    }


def _oracle(
    case: Case,
    types: list[type[Effect]],
    acting: Sequence[Effect],
    search: Search,
    diagnosis: Diagnosis,
) -> dict[str, Any]:
    """Held-out error over that of a fit that knows the effects at work, mean over channels."""
    if case.stratum not in ("effect", "pair"):
        return {}
    free = free_of(types)
    truth = {a.name: a for a in acting}
    at = [getattr(truth[f.name], f.parameter.name) for f in free]
    x = np.array(
        [(v - f.parameter.centre) / f.parameter.sigma for v, f in zip(at, free, strict=True)]
    )

    fitted = search.problem.descend(tuple(types), free, search.base.fitted.u, x)
    stack = search.problem.stack
    best = heldout.rmse(stack, heldout.held_out(fitted, heldout.run_folds(stack)).predicted)
    return {
        "oracle": float(np.mean([diagnosis.fit.after[c] / best[c] for c in best])),
        "before": float(np.mean([diagnosis.fit.before[c] / best[c] for c in best])),
        "truth_gain": search.base.fitted.nats - fitted.nats,
        "best_gain": search.base.fitted.nats - search.best().fitted.nats,
    }


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m gritd.tools.proof.ours.trials", description=__doc__
    )
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=[], help="strata or effects")
    parser.add_argument(
        "--strength",
        nargs=2,
        type=float,
        metavar=("LOW", "HIGH"),
        help="times the limit, all strata",
    )
    parser.add_argument(
        "--lack",
        choices=LACKS,
        default="",
        help="campaigns of one run, of one load, without force sensor",
    )
    parser.add_argument("--out", type=Path, help="one JSON line a case")
    arguments = parser.parse_args(argv)

    strength = tuple(arguments.strength) if arguments.strength else None
    chosen = list(cases(arguments.cases, arguments.seed, arguments.only, strength, arguments.lack))

    results = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for number, result in enumerate(pool.map(trial, chosen), 1):
            results.append(result)
            if arguments.out is not None:
                with arguments.out.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(result) + "\n")
            print(f"{number}/{len(chosen)} {_line(result)}", file=sys.stderr, flush=True)
    print(table(results))
    return 0


def _line(result: dict[str, Any]) -> str:
    if "verdict" not in result:
        return f"{result['stratum']} {result['truth']}: {result.get('error', 'cannot be seen')}"
    first = [round(v, 2) for v in list(result["probability"].values())[:3]]
    return (
        f"{result['stratum']} {'+'.join(result['truth'])}: {result['verdict']}"
        f" {result['accepted'] or result['first']} {first} p {result['p']:.3f}"
        f" {result['seconds']:.0f} s"
    )


if __name__ == "__main__":
    sys.exit(main())
