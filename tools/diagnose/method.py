"""The diagnosis of a rig's recordings, step by step: prepare, search, decide, locate, and say it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import EXPERIMENTS
from gritd.tools.diagnose.explain import law, locate
from gritd.tools.diagnose.explain import traces as evidence_files
from gritd.tools.diagnose.explain.experiment import next_experiment
from gritd.tools.diagnose.explain.result import Diagnosis, Fit, Hypothesis, Quantity, SoilFit, Test
from gritd.tools.diagnose.fit import heldout
from gritd.tools.diagnose.fit.heldout import Held
from gritd.tools.diagnose.fit.prepare import prepare
from gritd.tools.diagnose.fit.problem import Fitted
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.screen.screen import LEVEL
from gritd.tools.diagnose.search.search import Model, Search, run
from gritd.tools.diagnose.verdict.decide import Decision, decide

Step = Callable[[str], None]
SHOWN = 12  # hypotheses


def diagnose(
    rig: Rig,
    seed: int = 0,
    redo: Mapping[str, Any] | None = None,
    step: Step = lambda _: None,
    jobs: int = 1,
) -> Diagnosis:
    """Everything `gritd diagnose` says. Deterministic for a seed."""
    rng = np.random.default_rng(seed)
    step("fitting the soil and the noise")
    prepared = prepare(rig, rng)
    search = Search(prepared.problem, prepared.generics, prepared.draws, jobs=jobs)
    run(search, Model(prepared.base, (), 0.0), step)
    decision = decide(search)
    step("holding out runs and conditions")
    return said(rig, search, decision, redo or {}, seed)


def said(
    rig: Rig, search: Search, decision: Decision, redo: Mapping[str, Any], seed: int
) -> Diagnosis:
    """The result object of a search that was decided."""
    stack = search.problem.stack
    base = search.models[0]
    found = search.screens[()]
    folds, conditions = heldout.run_folds(stack), heldout.condition_folds(stack)
    accepted = decision.best if decision.verdict == "explained" else base
    before, after = heldout.held_out(base.fitted, folds), heldout.held_out(accepted.fitted, folds)
    bare = base if accepted is base else locate.bare(search, accepted)
    seen = before if bare is base else Held(before.log_density, bare.fitted.predicted)
    location = locate.locate(search, bare, seen.predicted) if found.alarmed else ()
    fitted_law = law.find(search, base, location) if decision.verdict == "unlisted" else None
    if fitted_law is not None:
        after = fitted_law.held
    hypotheses = _hypotheses(search, decision, folds, conditions)
    name, value = found.largest
    return Diagnosis(
        verdict=decision.verdict,
        summary=_summary(decision, hypotheses, location, found.p),
        test=Test(name, value, found.threshold, found.p, LEVEL, len(found.nulls)),
        location=location,
        hypotheses=hypotheses,
        soil=_soil(rig, base.fitted, fitted_law.fitted if fitted_law else accepted.fitted),
        fit=_fit(rig, stack, before, after, search),
        law=fitted_law.law if fitted_law else None,
        next_experiment=next_experiment(search, decision),
        caveats=tuple(_caveats(rig, search)),
        remaining=_remaining(decision),
        nuisance=_constants(rig, accepted.fitted, soil=False),
        noise=_noise(rig, search),
        baseline=tuple(e.name for e in rig.baseline),
        traces=evidence_files.traces(search, before, after),
        scatters=evidence_files.scatters(search, location, before, after),
        redo={**redo, "seed": seed},
    )


def _hypotheses(
    search: Search, decision: Decision, folds: list[Any], conditions: list[Any]
) -> tuple[Hypothesis, ...]:
    base, found = search.models[0], search.screens[()]
    before = [heldout.held_out(base.fitted, f) for f in (folds, conditions)]
    out = []
    for name, probability in sorted(decision.probability.items(), key=lambda item: -item[1])[
        :SHOWN
    ]:
        models = [m for m in search.models if name in m.names]
        accepted = decision.verdict == "explained" and name in decision.best.names
        best = decision.best if accepted else max(models, key=lambda m: m.evidence, default=None)
        alike = _alike(decision, name)
        out.append(
            Hypothesis(
                effect=name,
                probability=probability,
                heldout_gain_nats=_gain(before, best, (folds, conditions)) if best else 0.0,
                parameters=parameters(search.problem.stack.rig, best.fitted, name) if best else {},
                indistinguishable_from=alike,
                accepted=accepted,
                sentence=EFFECTS[name].sentence(),
                score_nats=found.evidence.get(name, 0.0),
                separated_by={r: EXPERIMENTS[k] for r in alike if (k := _key(name, r)) is not None},
            )
        )
    return tuple(out)


def _key(one: str, other: str) -> str | None:
    return EFFECTS[one].confusable_with.get(other) or EFFECTS[other].confusable_with.get(one)


def _alike(decision: Decision, name: str) -> tuple[str, ...]:
    """The rest of the group that an effect belongs to."""
    for leader, rivals in decision.groups.items():
        if name == leader or name in rivals:
            return tuple(n for n in (leader, *rivals) if n != name)
    return ()


def _gain(before: list[Held], model: Model, folds: tuple[list[Any], list[Any]]) -> float:
    """The smaller of the gains on held-out runs and on held-out conditions [nats]."""
    gains = [
        float((heldout.held_out(model.fitted, f).log_density - b.log_density).sum())
        for b, f in zip(before, folds, strict=True)
        if f
    ]
    return min(gains, default=0.0)


def parameters(rig: Rig, fitted: Fitted, name: str) -> dict[str, Quantity]:
    """Fitted values of an effect, in what its units mean for the rig."""
    sigma = np.sqrt(np.diag(fitted.covariance()))[len(fitted.u) :]
    return {
        p.name: Quantity(
            f.value(float(x)) * rig.stated(p.unit), float(s) * p.sigma * rig.stated(p.unit), p.unit
        )
        for f, x, s in zip(fitted.free, fitted.x, sigma, strict=False)
        if f.name == name and (p := f.parameter)
    }


def _constants(rig: Rig, fitted: Fitted, soil: bool) -> dict[str, Quantity]:
    sigma = np.sqrt(np.diag(fitted.covariance()))
    return {
        k.name: Quantity(k.of(float(u)), k.spread(float(u), float(s)), k.unit)
        for k, u, s in zip(rig.constants, fitted.u, sigma, strict=False)
        if k.soil == soil
    }


def _soil(rig: Rig, before: Fitted, after: Fitted) -> SoilFit | None:
    soil = [k for k in rig.constants if k.soil]
    if not soil:
        return None
    strain = {k.name: float(u) for k, u in zip(rig.constants, before.u, strict=True) if k.soil}
    prior = {k.name: Quantity(k.value, k.sigma, k.unit) for k in soil}
    return SoilFit(prior, _constants(rig, before, True), _constants(rig, after, True), strain)


def _fit(rig: Rig, stack: Any, before: Held, after: Held, search: Search) -> Fit:
    floor = {c: k.sigma for c, k in zip(rig.channels, search.problem.noise.colours, strict=True)}
    unit = {c: rig.units[c] for c in rig.channels}
    return Fit(
        unit, heldout.rmse(stack, before.predicted), heldout.rmse(stack, after.predicted), floor
    )


def _noise(rig: Rig, search: Search) -> dict[str, dict[str, float]]:
    colours = zip(rig.channels, search.problem.noise.colours, strict=True)
    return {
        c: {"sigma": k.sigma, "slow_time": k.time, "slow_share": k.slow, "fast_share": k.fast}
        for c, k in colours
    }


def _caveats(rig: Rig, search: Search) -> list[str]:
    said = list(rig.caveats)
    if len(rig.runs) == 1:
        said.append(
            "One run only: nothing tells a misfit from what was peculiar to that run; thirds of it were held out."
        )
    loads = (
        np.concatenate([run.covariates["load"] for run in rig.runs])
        if "load" in rig.runs[0].covariates
        else None
    )
    if loads is not None and np.ptp(loads) < 0.1 * max(float(np.max(loads)), 1e-9):
        said.append(
            "One load only: c and tan φ are nearly inseparable, and so are effects that differ by load alone."
        )
    if "drawbar_pull" not in rig.channels and any(k.soil for k in rig.constants):
        said.append("No force sensor: what acts on the drawbar pull alone cannot show.")
    return said


def _remaining(decision: Decision) -> str:
    if not decision.left_significant:
        return "Nothing above the noise remains."
    return f"Functions without a name would gain {decision.left:.0f} nats more: something remains."


def _summary(
    decision: Decision, hypotheses: tuple[Hypothesis, ...], location: Any, p: float
) -> str:
    if decision.verdict == "consistent":
        return f"Model and recordings agree (p = {p:.2g})."
    if decision.verdict == "insufficient":
        return f"No mismatch shows (p = {p:.2g}), but these recordings could not show most effects at their usual size."
    where = f" {location[0].where}." if location else ""
    if decision.verdict == "unlisted":
        return (
            f"Model and recordings differ (p = {p:.2g}) in a way no listed effect explains.{where}"
        )
    names = " and ".join(decision.best.names)
    alike = {r for n in decision.best.names for r in decision.groups.get(n, ())}
    doubt = (
        f" It cannot be told apart from {', '.join(sorted(alike))} with these recordings."
        if alike
        else ""
    )
    verb = "explains" if len(decision.best.names) == 1 else "explain"
    return f"Model and recordings differ (p = {p:.2g}); {names} {verb} {decision.share:.0%} of it.{doubt}{where}"
