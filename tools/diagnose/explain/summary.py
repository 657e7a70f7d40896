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
from gritd.tools.diagnose.verdict.decision import Decision, Resembled

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
    if decision.verdict in ("consistent", "insufficient"):
        return _quiet(decision, f"{subject} agree {p}", p, strained)

    sentences = [f"{subject} differ {p}."]
    if location:
        first = location[0]
        unseen = "" if first.channel in worse(fit) else f"; {_held_out(fit, first.channel)}"
        sentences = [f"{first.where} {p}{unseen}."]
    if decision.verdict == "unlisted":
        resembled = [(r, decision.groups.get(r.name, ())) for r in decision.resembled]
        sentences += [_unexplained(decision), *(_resembling(*each) for each in resembled)]
        return " ".join(sentences)

    names = listed(list(decision.best.names))
    verb = "explains" if len(decision.best.names) == 1 else "explain"
    sentences.append(f"{names} {verb} {percent(decision.share)} of the misfit.")
    return " ".join((*_worse(fit), *sentences, *_alike(decision), *_beside(decision)))


def worse(fit: Fit) -> list[str]:
    """Channels whose held-out error has grown beyond the noise, the worst first: what was found
    explains the misfit in part at best.
    """
    grown = {c: fit.after[c] - fit.before[c] for c in fit.unit}
    share = TUNING.explain.held_out_worse
    far = [c for c in grown if grown[c] > share * max(fit.before[c], fit.noise_floor[c])]
    return sorted(far, key=lambda c: -grown[c] / fit.noise_floor[c])


def _quiet(decision: Decision, agree: str, p: str, strained: Sequence[tuple[str, float]]) -> str:
    far = listed([f"{name} {sigmas(strain)}" for name, strain in strained])
    if decision.verdict == "consistent":
        return f"{agree}{f' only with {far} from what is known' if far else ''}."
    return (
        f"No mismatch shows {p}{f' but for {far} from what is known' if far else ''}, and these"
        " recordings could not show most effects at their usual size."
    )


def _held_out(fit: Fit, channel: str) -> str:
    unit, factor = shown(fit.unit[channel])
    before, after = (number(of[channel] * factor) for of in (fit.before, fit.after))
    return f"{spelled(channel)} on unseen runs {before} {unit} off before, {after} after"


def _worse(fit: Fit) -> Iterator[str]:
    if far := worse(fit):
        each = listed([_held_out(fit, channel) for channel in far])
        these = "these channels: their" if far[1:] else "this channel: its"
        yield (
            f"In part only: {each}. Check how the configuration maps {these} side of the drive,"
            " sign and scale."
        )


def _alike(decision: Decision) -> Iterator[str]:
    """Of each accepted name, what it cannot be distinguished from."""
    names = decision.best.names
    for name in names:
        if rivals := decision.groups.get(name):
            it = name if len(names) > 1 else "It"
            alike = ", ".join(sorted(rivals))
            yield f"{it} cannot be distinguished from {alike} with these recordings."


def _beside(decision: Decision) -> Iterator[str]:
    for of in decision.resembled:
        yield f"What {of.name} would add is something else: its form fits badly."


def _unexplained(decision: Decision) -> str:
    """That no effect is named; where some are likely together but none alone, which."""
    chances = sorted(decision.probability.items(), key=lambda item: -item[1])
    best = chances[0][1] if chances else 0.0
    alike = {name: p for name, p in chances if p > best * np.exp(-TUNING.verdict.alike)}
    together = sum(alike.values())
    if len(alike) < 2 or not best <= decision.unlisted < together:
        return "No listed effect explains it."
    return (
        f"One of {', '.join(alike)} is there with {percent(together)}, but none of these alone is"
        f" likelier than that nothing of the list is ({percent(decision.unlisted)})."
    )


def _resembling(of: Resembled, rivals: Sequence[str]) -> str:
    """What resembles the misfit as well as its rivals do, and why it does not explain it."""
    why = (
        f"in a form {percent(of.forms)} off ours"
        if round(of.forms, 2) > 0.0
        else "and no more of it"
    )
    if not of.predicts:
        why = "but unseen runs are predicted worse with it"
    where = PLACE_OF[EFFECTS[of.name].stage]
    taken = f"takes {percent(of.share)} of the misfit, {why}: probably something else in {where}."
    if not rivals:
        return f"It resembles {of.name}, which {taken}"
    alike = ", ".join((of.name, *sorted(rivals)))
    return f"It resembles {alike}, which these recordings do not distinguish. {of.name} {taken}"
