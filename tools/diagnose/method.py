"""The method of the diagnosis, in the order in which it runs.

    signals      readings of every recording on a common grid           rig/signals.py
    ripples      of the wheel, at the recordings' own rate               orders/lines.py
    rig          channels, constants with their priors, a prediction     rig/interface.py
    reference    what it shows by itself, the steps below for it alone   verdict/baseline.py
    noise        size and colour of each channel, from the recordings    noise/estimate.py
    fit          soil and calibration within what is known of them       fit/base.py
    screen       one pass: the evidence of every effect, and an alarm    screen/screening.py
    search       nonlinear fits, one more effect at a time               search/search.py
    verdict      probabilities, groups, "unlisted"                       verdict/decide.py
    explanation  where, how sure, how much better, what to do next       explain/explanation.py

`rig/adapter.py` makes a rig of recordings, which are the first three lines; `diagnose` begins with
it. Each step is one call, and hands one frozen value to the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from gritd.tools.cli.memory import give_back
from gritd.tools.diagnose.explain.explanation import explain
from gritd.tools.diagnose.explain.held_against import with_reference
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.fit.base import BaseFit, explainable, fit_roughly, refit
from gritd.tools.diagnose.fit.reference import fit_beside_reference
from gritd.tools.diagnose.noise.estimate import estimate
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import search_models
from gritd.tools.diagnose.tuning import TUNING, replaced
from gritd.tools.diagnose.verdict.baseline import (
    baseline_effects,
    shown_as_well,
    shown_unsurely,
)
from gritd.tools.diagnose.verdict.decide import decide
from gritd.tools.diagnose.verdict.decision import Decision

OF_REFERENCE = "the reference: "  # what is done with it alone


def diagnose(
    rig: Rig,
    seed: int = 0,
    redo: Mapping[str, Any] | None = None,
    step: Callable[[str], None] = lambda _: None,
    jobs: int = 1,
    quick: bool = False,
) -> Diagnosis:
    """Everything `gritd diagnose` says of a rig's recordings. Nothing is drawn: the same recordings
    give the same result.

    seed, redo: kept in the result; step: is given what begins; jobs: processes that fit; quick: a
    first answer, for which only the likeliest effects are fitted, each alone.
    """
    kept = {**(redo or {}), "seed": seed}
    if quick:  # what the reference shows by itself takes a search of its own
        with first_answer():
            return _diagnose(rig, None, kept, step, jobs)
    return _diagnose(*accustomed(rig, step, jobs), kept, step, jobs)


@contextmanager
def first_answer() -> Iterator[None]:
    """The search ends after the likeliest single effects."""
    few = TUNING.search.effects_quick
    with replaced("search", effects_first=few, later=()):
        yield


def _diagnose(
    rig: Rig,
    of_reference: Decision | None,
    redo: Mapping[str, Any],
    step: Callable[[str], None],
    jobs: int,
) -> Diagnosis:
    step("fitting the soil and the noise")
    base = fit_base(rig, jobs)
    known = shown_unsurely(base, of_reference)
    if not known:
        give_back()
        search = search_models(prepare_screening(base), step, jobs)
        decision = decide(search, jobs, step)
        known = shown_as_well(base, decision.best)
    if known and rig.having:  # from the beginning: what is noise and what is usual is another
        return _diagnose(rig.having(known), of_reference, redo, step, jobs)

    step("holding out runs and conditions")
    found = explain(search, decision, redo, jobs)
    if all(rig.new):
        return found
    return with_reference(found, rig, of_reference.verdict if of_reference else None)


def accustomed(
    rig: Rig, step: Callable[[str], None] = lambda _: None, jobs: int = 1
) -> tuple[Rig, Decision | None]:
    """The rig with what its reference shows by itself in both campaigns, and what is decided of it;
    a rig without a reference as it is.
    """
    if rig.reference is None or rig.having is None:
        return rig, None
    alone = rig.reference()

    def said(what: str) -> None:
        step(f"{OF_REFERENCE}{what}")

    said("fitting the soil and the noise")
    base = fit_base(alone, jobs)
    with replaced("verdict", companion=0.0):  # what it shows is not named, but had
        search = search_models(prepare_screening(base), said, jobs)
    decision = decide(search, jobs, said)
    return rig.having(baseline_effects(alone, decision)), decision


def fit_base(rig: Rig, jobs: int = 1) -> BaseFit:
    """The base model in noise of the recordings' own size and colour.

    Fitted roughly first, in white noise: what is left when everything is explained away is noise.
    With a reference campaign, what is left of it beside the discrepancy of form is noise: the rig
    does it with nothing new.

    jobs: processes.
    """
    stack = Stack(rig)
    rough = fit_roughly(stack)

    if stack.referred:
        return fit_beside_reference(rough)
    noise = estimate(stack, rough.fitted.predicted, explainable(rough), rough.problem.noise, jobs)
    return refit(rough, noise)
