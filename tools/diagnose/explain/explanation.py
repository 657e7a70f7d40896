"""From a verdict to everything that `gritd diagnose` says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot
from typing import Any

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import meanwhile
from gritd.tools.cli.wording import listed
from gritd.tools.diagnose.explain.doubts import doubts, strained, strains
from gritd.tools.diagnose.explain.experiment import next_experiment
from gritd.tools.diagnose.explain.law import find_law
from gritd.tools.diagnose.explain.learnt import learnt_form
from gritd.tools.diagnose.explain.locate import locate, unmoved
from gritd.tools.diagnose.explain.profile import profile_of
from gritd.tools.diagnose.explain.reach import reached
from gritd.tools.diagnose.explain.remainder import discrepancies, missed_words, remainders
from gritd.tools.diagnose.explain.result import (
    Diagnosis,
    Explanation,
    Fit,
    Hypothesis,
    Location,
    Quantity,
    Remainder,
    Test,
)
from gritd.tools.diagnose.explain.ripples import left_over, ripples_of
from gritd.tools.diagnose.explain.soil import constants_of, soil_of
from gritd.tools.diagnose.explain.summary import summary
from gritd.tools.diagnose.explain.traces import scatters, traces
from gritd.tools.diagnose.explain.wording import OSCILLATES, described, label
from gritd.tools.diagnose.fit.heldout import HeldOut, condition_folds, held_out, rmse, run_folds
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.rig.interface import Bools, Rig
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import without
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.decision import QUIET, Decision


def explain(
    search: EffectSearch, decision: Decision, redo: Mapping[str, Any], jobs: int = 1
) -> Diagnosis:
    """The result object of a search that was decided. redo: what doing it again needs; jobs:
    processes.
    """
    problem, rig, base = search.problem, search.problem.stack.rig, search.base
    folds = run_folds(problem.stack)
    accepted = decision.best
    whole = decision.beside.model if decision.beside is not None else accepted
    before, after = held_out(base.fitted, folds), held_out(whole.fitted, folds)

    with meanwhile(jobs, lambda: _located(search, accepted, before)) as located:
        hypotheses = _hypotheses(search, decision, folds)
        soil = soil_of(problem, base.fitted, decision)
        learnt = learnt_form(problem, accepted, soil.after) if soil is not None else None
        location = located()
    proposed = next_experiment(search, decision, location)

    unlisted = decision.verdict == "unlisted"
    law = find_law(search, location, soil, after) if unlisted else None
    left, fit = remainders(problem, accepted), _fit(problem, before, after)
    screen, far = search.first, strains(rig, accepted)
    return Diagnosis(
        verdict=decision.verdict,
        summary=summary(decision, location, fit, screen, rig, far),
        test=Test(
            label(screen.largest), screen.ratio, screen.threshold, screen.p, TUNING.screen.level, 0
        ),
        location=location,
        hypotheses=hypotheses,
        soil=soil,
        fit=fit,
        law=law,
        next_experiment=proposed,
        caveats=_caveats(search, decision, redo, location),
        share=decision.share,
        remaining=left,
        remaining_words=_remaining(rig, decision, bool(far), left),
        discrepancy=discrepancies(problem, accepted),
        nuisance=constants_of(rig, accepted.fitted, soil=False),
        noise=_noise(problem),
        reference=None,
        explanations=tuple(
            Explanation(
                w.names,
                w.nameless,
                w.evidence,
                w.probability * (w.listed if w.names else 1.0),
                w.share,
                w.trust,
            )
            for w in decision.weighed
        ),
        lines=ripples_of(rig),
        candidates=len(rig.effects),
        learnt=learnt,
        baseline=tuple(e.name for e in rig.baseline),
        traces=traces(problem, before, after),
        scatters=scatters(problem, location, before, after),
        redo=redo,
    )


def _located(search: EffectSearch, accepted: Model, before: HeldOut) -> tuple[Location, ...]:
    """Where the misfit was made: of the base model held at what was found beside the accepted
    effects.
    """
    if not search.first.alarmed:
        return ()
    if not accepted.names:
        return locate(search.screening, search.base, before.predicted)
    held = unmoved(search.screening, accepted)
    return locate(search.screening, held, held.fitted.predicted)


def _hypotheses(
    search: EffectSearch, decision: Decision, folds: Sequence[Bools]
) -> tuple[Hypothesis, ...]:
    every = (folds, condition_folds(search.problem.stack))
    before = [held_out(search.base.fitted, f) for f in every]
    resembled = {of.name: of.model for of in decision.resembled}
    out = []
    rig = search.problem.stack.rig
    said = rig.words.menu.said
    for name, probability in _ranked(search, decision):
        models = [m for m in search.models if name in m.names]
        likeliest = max(models, key=lambda m: m.evidence, default=None)
        accepted = decision.verdict == "explained" and name in decision.best.names
        best = decision.best if accepted else resembled.get(name, likeliest)
        alike = _alike(decision, name)
        forms = best.form_share(name) if best else 0.0
        far = reached(search, best, name) if accepted and best else None
        out.append(
            Hypothesis(
                effect=name,
                probability=probability,
                heldout_gain_nats=_gain(before, best, every) if best else 0.0,
                parameters=parameters(rig, best, name, forms, far) if best else {},
                indistinguishable_from=alike,
                accepted=accepted,
                sentence=EFFECTS[name].sentence(),
                equation=EFFECTS[name].equation(),
                score_nats=search.first.evidence.get(name, 0.0),
                separated_by={r: said[k] for r in alike if (k := _key(name, r)) is not None},
                other_forms=forms,
                profile=profile_of(search.problem, best, name) if best else {},
            )
        )

    return tuple(out)


def _ranked(search: EffectSearch, decision: Decision) -> list[tuple[str, float]]:
    """Effects and their probabilities, the likeliest first; of accepted ones that are as likely the
    one first without which the evidence falls most.
    """
    best = decision.best
    several = decision.verdict == "explained" and len(best.names) > 1
    lost = {
        name: best.evidence - without(search, best, name).evidence
        for name in (best.names if several else ())
    }

    def order(item: tuple[str, float]) -> tuple[float, float, float]:
        name, probability = item
        return -round(probability, 2), -lost.get(name, 0.0), -probability

    return sorted(decision.probability.items(), key=order)


def _key(one: str, other: str) -> str | None:
    """The experiment that tells two effects apart."""
    return EFFECTS[one].confusable_with.get(other) or EFFECTS[other].confusable_with.get(one)


def _alike(decision: Decision, name: str) -> tuple[str, ...]:
    """The rest of the group that an effect belongs to."""
    for leader, rivals in decision.groups.items():
        if name == leader or name in rivals:
            return tuple(n for n in (leader, *rivals) if n != name)
    return ()


def _gain(before: list[HeldOut], model: Model, every: Sequence[Sequence[Bools]]) -> float:
    """The smaller of the gains on held-out runs and on held-out conditions [nats]."""
    gains = [
        float((held_out(model.fitted, folds).log_density - held.log_density).sum())
        for held, folds in zip(before, every, strict=True)
        if folds
    ]
    return min(gains, default=0.0)


def parameters(
    rig: Rig, model: Model, name: str, forms: float = 0.0, far: Array | None = None
) -> dict[str, Quantity]:
    """What a model says of an effect's parameters, in what their units mean for the rig.

    forms: the share by which another form of the effect may differ. Its strength differs by as
    much: the fit alone knows a strength as if our formula were exact. far: (p,) σ of the model's
    parameters where the fit's are too small (`reach.py`), in expected sizes.
    """
    found = {}
    mean, sigma = model.parameters()
    sigma = sigma if far is None else np.maximum(sigma, far)
    for f, x, s in zip(model.fitted.free, mean, sigma, strict=True):
        if f.name == name and (p := f.parameter):
            value, own = f.value(float(x)), float(s) * p.sigma
            unit = rig.unit_factors.get(p.unit, 1.0)
            other = forms * (value - p.off) if p.role == "strength" else 0.0
            found[p.name] = Quantity(value * unit, hypot(own, other) * unit, p.unit)
    return found


# ---- fit and noise -- ------------------------------------------------------------------


def _fit(problem: Problem, before: HeldOut, after: HeldOut) -> Fit:
    stack, rig = problem.stack, problem.stack.rig
    floor = {c: k.sigma for c, k in zip(rig.channels, problem.noise.colours, strict=True)}
    unit = {c: rig.units[c] for c in rig.channels}
    return Fit(unit, rmse(stack, before.predicted), rmse(stack, after.predicted), floor)


def _noise(problem: Problem) -> dict[str, dict[str, float]]:
    colours = zip(problem.stack.rig.channels, problem.noise.colours, strict=True)
    return {
        c: {"sigma": k.sigma, "slow_time": k.time, "slow_share": k.slow, "fast_share": k.fast}
        for c, k in colours
    }


# ---- in words ----------------------------------------------------------------------------------


def _caveats(
    search: EffectSearch,
    decision: Decision,
    redo: Mapping[str, Any],
    location: Sequence[Location],
) -> tuple[str, ...]:
    """Sentences on what to doubt."""
    rig, noise = search.problem.stack.rig, search.problem.noise
    whole = decision.beside.model if decision.beside is not None else decision.best
    sentences = list(rig.words.caveats)
    if search.failed:
        names = listed(sorted({" with ".join(of) for of in search.failed}))
        sentences.append(f"Left out, for their algebra failed: {names}.")
    if redo.get("quick"):
        sentences.append(
            "A first answer (--quick): the likeliest effects were fitted one at a time, and no"
            " second one was looked for."
        )
    if len(rig.runs) == 1:
        sentences.append(
            "One run only: nothing tells a misfit from what was peculiar to that run;"
            " thirds of it were held out."
        )

    acting = (*rig.baseline, *decision.best.fitted.acting)
    told = decision.verdict in QUIET  # in the summary
    return (
        *sentences,
        *rig.words.shortcomings,
        *(() if told else strained(rig, whole)),
        *doubts(rig, whole, noise),
        *left_over(rig, acting, {x.channel for x in location if OSCILLATES in x.where}),
    )


def _remaining(rig: Rig, decision: Decision, strained: bool, left: Mapping[str, Remainder]) -> str:
    """strained: whether constants are far from what is known of them; left: what the equations and
    the accepted names miss of each channel.
    """
    if decision.beside is not None:
        kinds = dict.fromkeys(described(f.shape, rig.units) for f in decision.beside.functions)
        return f"Something without a name remains: {', '.join(kinds)}."

    quiet = decision.verdict in QUIET
    missed = [words for c, each in left.items() if (words := missed_words(c, each, not quiet))]
    if missed:
        without = "Without its discrepancy of form, the model" if rig.forms else "The model"
        return f"{without} misses {listed(missed)}."
    if strained:
        return "Nothing above the noise remains but what strained constants take up."
    if decision.verdict == "unlisted":
        return "Soil and calibration can take up the misfit, within what is known of them."
    return "Nothing above the noise remains."
