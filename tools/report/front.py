"""The first page of a diagnosis: the verdict, the few numbers behind it, and the rig and the runs
it was made from.
"""

from __future__ import annotations

from collections.abc import Iterator

from gritd.tools.cli.wording import listed, number, percent, shown
from gritd.tools.diagnose.explain.result import Diagnosis, Hypothesis, SoilFit
from gritd.tools.report import masthead, tables
from gritd.tools.report.html import Markup, tag
from gritd.tools.report.words import (
    counted,
    held,
    name_of,
    nats,
    probability,
    quantity,
    with_unit,
)

VERDICTS = {  # verdict -> its name, and what it means
    "consistent": ("Consistent", "Model and recordings agree within the noise."),
    "explained": ("Explained", "Model and recordings differ, and listed physics explains it."),
    "unlisted": (
        "Not in the list",
        "Model and recordings differ, and no listed effect explains it.",
    ),
    "insufficient": ("Not decided", "These recordings cannot tell."),
}
RUNS, RIG = "runs", "rig"  # keys of `Diagnosis.redo`, which the first page tells


def verdict(diagnosis: Diagnosis) -> Markup:
    """The verdict in one paragraph, the numbers behind it, and of which rig and day it is."""
    name, meaning = VERDICTS[diagnosis.verdict]
    explained = diagnosis.verdict == "explained"
    effects = [_or_alike(h) for h in diagnosis.accepted] if explained else []
    title = f"{name}: {listed(effects)}" if effects else name

    runs = {trace.run for trace in diagnosis.traces}

    return tag(
        "header",
        tag("p", f"gritd diagnose · {counted(len(runs), 'run')}", class_="kicker"),
        tag("h1", title, tag("span", meaning)),
        tag("p", held(tables.named(diagnosis, diagnosis.summary)), class_="summary"),
        tag("dl", (_figure(*figure) for figure in _figures(diagnosis)), class_="figures"),
        masthead.masthead(diagnosis.redo.get(RIG, ""), diagnosis.redo.get(RUNS, ()))
        if RUNS in diagnosis.redo
        else None,
        class_=f"verdict {diagnosis.verdict}",
    )


def runs(diagnosis: Diagnosis) -> Markup | None:
    """What was driven, and what was noted of it."""
    return masthead.runs(diagnosis.redo.get(RUNS, ()))


def explanation(diagnosis: Diagnosis) -> str:
    """What makes the difference between before and after, in words."""
    if diagnosis.accepted:
        return (
            name_of(diagnosis.accepted[0].effect)
            if len(diagnosis.accepted) == 1
            else f"these {len(diagnosis.accepted)} effects"
        )
    return "the empirical law" if diagnosis.law else "it"


def _or_alike(h: Hypothesis) -> str:
    return name_of(h.effect) + " or similar" * bool(h.indistinguishable_from)


def _together(diagnosis: Diagnosis, h: Hypothesis) -> float:
    """Probability that it is this effect or one like it."""
    group = {h.effect, *h.indistinguishable_from}
    return min(
        sum(other.probability for other in diagnosis.hypotheses if other.effect in group), 1.0
    )


def _accepted(diagnosis: Diagnosis, h: Hypothesis) -> tuple[str, str, str]:
    """An effect or an undistinguished group, with its probability and its strength."""
    parameters = "; ".join(f"{name_of(name)} {quantity(q)}" for name, q in h.known.items())
    return _or_alike(h), f"{percent(_together(diagnosis, h))} probable", parameters


def _figure(term: str, value: str, detail: str) -> Markup:
    return tag(
        "div",
        tag("dt", term),
        tag("dd", held(value)),
        tag("dd", held(detail), class_="detail") if detail else None,
    )


def _figures(diagnosis: Diagnosis) -> Iterator[tuple[str, str, str]]:
    """The few numbers a hurried reader takes away: what, how much, compared with what."""
    channel = _most_improved(diagnosis)
    if channel:
        fell, floor = change(diagnosis, channel)
        yield f"{name_of(channel)} error on unseen runs", fell, f"noise {floor}"

    for h in diagnosis.accepted:
        yield _accepted(diagnosis, h)

    for key in ("c", "tan_phi"):
        if diagnosis.soil is not None and key in diagnosis.soil.after:
            yield name_of(key), quantity(diagnosis.soil.after[key]), _without(diagnosis.soil, key)

    test = diagnosis.test
    alarm = f"alarm above {nats(test.threshold)}; p {probability(test.p)}"
    yield "evidence of a mismatch", nats(test.statistic), alarm


def _without(soil: SoilFit, key: str) -> str:
    known = f"known before {quantity(soil.prior.get(key))}"
    return (
        known if soil.before == soil.after else f"{quantity(soil.before.get(key))} without; {known}"
    )


def _most_improved(diagnosis: Diagnosis) -> str | None:
    """The channel whose held-out error fell most, as a share."""
    fit = diagnosis.fit
    known = [c for c in fit.before if c in fit.after and fit.before[c] > 0.0]
    return min(known, key=lambda c: fit.after[c] / fit.before[c]) if known else None


def change(diagnosis: Diagnosis, channel: str) -> tuple[str, str]:
    """Held-out error before and after, and the noise floor, with their unit."""
    unit = diagnosis.fit.unit.get(channel, "")
    seen, factor = shown(unit)
    before, after = (
        number(side[channel] * factor, 2) for side in (diagnosis.fit.before, diagnosis.fit.after)
    )
    change = before if before == after else f"{before} → {after}"
    return f"{change} {seen}".rstrip(), with_unit(diagnosis.fit.noise_floor.get(channel), unit, 2)
