"""Hypotheses as a ranked list with bars; those that the recordings cannot distinguish stand in one
box.
"""

from __future__ import annotations

from collections.abc import Sequence

from gritd.tools.cli.wording import listed, number, percent
from gritd.tools.diagnose.explain.result import Diagnosis, Hypothesis
from gritd.tools.report.html import Child, Markup, table, tag
from gritd.tools.report.words import counted, held, name_of, nats

UNLIKELY = 0.01  # hypotheses below this are folded away
MOST = 8  # groups in view
TIE = 2  # decimals of a probability: effects that differ by less are as probable


def introduction(diagnosis: Diagnosis) -> str:
    tried = counted(len(diagnosis.hypotheses), "effect")
    floating = "the soil" if diagnosis.soil else "what is known of the rig"
    return (
        f"{tried} considered together with {floating} in all channels, "
        "scored on runs and conditions not fitted to. "
        "A probability is the share of an effect among all that was weighed: each effect alone, "
        "sets of them, no effect at all, and something that is not in the list. "
        "A gain is in nats: 3 nats make an effect twenty times as probable."
    )


def groups(of: Sequence[Hypothesis]) -> Markup:
    """Likely ones as bars, the rest in a folded table."""
    grouped = together(of)
    likely = [g for g in grouped if _likely(g)][:MOST]
    rest = [h for g in grouped if g not in likely for h in g]
    return tag("div", (_group(g) for g in likely), _rest(rest, bool(likely)), class_="hypotheses")


def together(of: Sequence[Hypothesis]) -> list[list[Hypothesis]]:
    """Groups joined by `indistinguishable_from`, accepted ones first, then in the given order."""
    known = {h.effect for h in of}
    groups: list[list[Hypothesis]] = []

    for h in of:
        near = {h.effect, *h.indistinguishable_from} & known
        joined = [
            g
            for g in groups
            if any(o.effect in near or h.effect in o.indistinguishable_from for o in g)
        ]
        groups = [g for g in groups if g not in joined]
        groups.append([o for g in joined for o in g] + [h])

    order = {h.effect: _rank(h, place) for place, h in enumerate(of)}
    ranked = [sorted(group, key=lambda h: order[h.effect]) for group in groups]
    return sorted(ranked, key=lambda group: order[group[0].effect])


def _rank(h: Hypothesis, place: int) -> tuple[bool, float, int, int]:
    """Accepted ones first, then the likelier; in a tie the simpler, which has fewer parameters."""
    return not h.accepted, -round(h.probability, TIE), len(h.parameters), place


def _likely(group: Sequence[Hypothesis]) -> bool:
    return any(h.accepted for h in group) or max(h.probability for h in group) >= UNLIKELY


def _group(group: Sequence[Hypothesis]) -> Markup:
    if len(group) == 1:
        return tag("div", _bar(group[0]), class_="group")

    total = min(sum(h.probability for h in group), 1.0)
    note = f"Not distinguished by these recordings; together {percent(total)}."
    bars = (_bar(h) for h in group)

    return tag(
        "div",
        tag("p", held(note), class_="apart"),
        bars,
        _separation(group),
        class_="group several",
    )


def _bar(h: Hypothesis) -> Markup:
    width = f"width:{100.0 * min(max(h.probability, 0.0), 1.0):.1f}%"

    label = tag(
        "p", tag("b", name_of(h.effect)), " accepted" if h.accepted else None, class_="effect"
    )
    value = tag(
        "p",
        tag("b", percent(h.probability)),
        f" · gain {nats(h.heldout_gain_nats)}",
        class_="value",
    )
    track = tag(
        "div",
        tag("div", style=width),
        class_="track accepted" if h.accepted else "track",
        aria_hidden="true",
    )

    return tag(
        "div",
        label,
        value,
        track,
        tag("p", h.sentence, class_="note") if h.sentence else None,
        tag("pre", h.equation) if h.equation else None,
        class_="bar",
    )


def _separation(group: Sequence[Hypothesis]) -> Child:
    """What would tell the members apart, each way once."""
    inside = {h.effect for h in group}
    ways: dict[str, list[str]] = {}

    for h in group:
        for rival, how in h.separated_by.items():
            pair = listed(sorted((name_of(h.effect), name_of(rival))))
            if rival in inside and pair not in ways.setdefault(how, []):
                ways[how].append(pair)

    items = (tag("li", f"{'; '.join(pairs)}: {how}") for how, pairs in ways.items())
    return (
        (tag("p", "What would distinguish them:", class_="note"), tag("ul", items, class_="note"))
        if ways
        else None
    )


def _rest(of: Sequence[Hypothesis], others: bool) -> Child:
    if not of:
        return None

    least = (
        f", each below {percent(max(max(h.probability for h in of), UNLIKELY))}" if others else ""
    )
    summary = f"{counted(len(of), 'other effect' if others else 'effect')} tried{least}"
    rows = [(name_of(h.effect), percent(h.probability), number(h.heldout_gain_nats, 2)) for h in of]

    return tag(
        "details",
        tag("summary", summary),
        table(("effect", "probability", "held-out gain [nats]"), rows, numbers=1),
    )
