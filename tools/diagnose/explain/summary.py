"""The first sentences of a diagnosis: where, how much, before and after on runs that were held out,
and what explains it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.tools.cli.wording import chance, listed, number, percent, shown, sigmas, spelled
from gritd.tools.diagnose.explain.result import Fit, Location
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.screen.screening import Screen
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.decision import QUIET, Decision, Resembled

PLACE_OF = {  # stage of an effect -> where it acts
    "soil": "the soil",
    "contact": "the soil",
    "wheel": "the wheel",
    "testbed": "the testbed",
    "drivetrain": "the drive",
    "sensor": "the sensors",
}


def summary(
    decision: Decision,
    location: Sequence[Location],
    fit: Fit,
    screen: Screen,
    rig: Rig,
    strained: Sequence[tuple[str, float]] = (),
) -> str:
    """strained: constants far from what is known of them [σ]."""
    subject = "Model and recordings" if all(rig.new) else "Reference and new campaign"
    p = f"({chance(screen.p)})"
    if decision.verdict in QUIET:
        return _quiet(decision, f"{subject} agree {p}", p, strained)

    sentences = [f"{subject} differ {p}."]
    if location:
        first = location[0]
        off = _off(fit, first.channel, decision.verdict == "explained")
        unseen = "" if first.channel in worse(fit) else f"; on unseen runs {off}"
        sentences = [f"{first.where} {p}{unseen}."]
    if decision.verdict == "unlisted":
        resembled = [(r, decision.groups.get(r.name, ())) for r in decision.resembled]
        sentences += [_unexplained(decision), *(_resembling(decision, *each) for each in resembled)]
        return " ".join(sentences)

    names = [_likely(decision, name) for name in decision.best.names]
    verb = "explains" if len(names) == 1 else "explain"
    sentences.append(f"{listed(names)} {verb} {percent(decision.share)} of the misfit.")
    worst = _worse(fit, decision.best.names)
    return " ".join((*worst, *sentences, *_alike(decision), *_beside(decision)))


def worse(fit: Fit) -> list[str]:
    """Channels whose held-out error has grown by more than their noise, the worst first: what was
    found explains the misfit in part at best.
    """
    grown = {c: (fit.after[c] - fit.before[c]) / fit.noise_floor[c] for c in fit.unit}
    return sorted((c for c in grown if grown[c] > 1.0), key=lambda c: -grown[c])


def _quiet(decision: Decision, agree: str, p: str, strained: Sequence[tuple[str, float]]) -> str:
    far = listed([f"{name} {sigmas(strain)}" for name, strain in strained])
    if decision.verdict == "consistent":
        return f"{agree}{f' only with {far} from what is known' if far else ''}."
    return (
        f"No mismatch shows {p}{f' but for {far} from what is known' if far else ''}, and these"
        " recordings could not show most effects at their usual size."
    )


def _off(fit: Fit, channel: str, named: bool = True) -> str:
    """Held-out error of a channel; if something is named, before and after."""
    unit, factor = shown(fit.unit[channel])
    before, after = (number(of[channel] * factor) for of in (fit.before, fit.after))
    return f"{before} {unit} off before, {after} after" if named else f"{before} {unit} off"


def _worse(fit: Fit, names: Sequence[str]) -> Iterator[str]:
    """names: of the effects that are accepted."""
    if far := worse(fit):
        each = listed([f"{spelled(c)} on unseen runs {_off(fit, c)}" for c in far])
        free = [name for name in names if EFFECTS[name].free_along]
        check = "Check sign, scale and place of this in the configuration."
        if free:
            check = f"No run foretells what {listed(free)} does in another."
        yield f"In part only: {each}. {check}"


def _likely(decision: Decision, name: str) -> str:
    """An effect with its probability."""
    return f"{name} ({percent(decision.probability.get(name, 0.0))})"


def _alike(decision: Decision) -> Iterator[str]:
    """Of each accepted name, what it cannot be distinguished from."""
    names = decision.best.names
    for name in names:
        if rivals := decision.groups.get(name):
            it = name if len(names) > 1 else "It"
            alike = listed([_likely(decision, rival) for rival in rivals])
            yield f"{it} cannot be distinguished from {alike} with these recordings."


def _beside(decision: Decision) -> Iterator[str]:
    for of in decision.resembled:
        yield f"What {of.name} would add is something else: its form fits badly."


def _unexplained(decision: Decision) -> str:
    """That no effect is named; which are likely, and how likely it is that none of the list is
    there.
    """
    chances = sorted(decision.probability.items(), key=lambda item: -item[1])
    best = chances[0][1] if chances else 0.0
    alike = [name for name, p in chances if p > best * np.exp(-TUNING.verdict.alike)]
    together = sum(decision.probability[name] for name in alike)
    if decision.resembled or together <= decision.unlisted:
        return "No listed effect explains it."
    each = listed([_likely(decision, name) for name in alike])
    none = percent(decision.unlisted)
    return f"No listed effect is sure enough to be named: {each}; none of the list: {none}."


def _resembling(decision: Decision, of: Resembled, rivals: Sequence[str]) -> str:
    """What resembles the misfit as well as its rivals do, and why it does not explain it."""
    how = f" if its formula is bent by {percent(of.forms)}" if round(of.forms, 2) > 0.0 else ""
    if not of.predicts:
        how = ", but unseen runs are predicted worse with it"
    share = percent(of.share)
    if share == percent(0.0):
        share, how = "none", " by our formula"
    where = PLACE_OF[EFFECTS[of.name].stage]
    taken = f"takes {share} of the misfit{how}: probably something else in {where}."
    if not rivals:
        return f"It resembles {_likely(decision, of.name)}, which {taken}"
    alike = ", ".join(_likely(decision, name) for name in (of.name, *rivals))
    return f"It resembles {alike}, which these recordings do not distinguish. {of.name} {taken}"
