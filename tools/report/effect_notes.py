"""The effects that a page names: what each is, its formula and where it shows, at the end."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.effects import EFFECTS
from gritd.tools.diagnose.explain.result import Hypothesis
from gritd.tools.report.html import Markup, section, tag
from gritd.tools.report.words import name_of, sentence


def anchor(effect: str) -> str:
    return f"effect-{effect}"


def linked(effect: str) -> Markup:
    """The effect's name, with a link to its notes where there are some."""
    if effect not in EFFECTS:
        return tag("span", name_of(effect))
    return tag("a", name_of(effect), href=f"#{anchor(effect)}")


def notes(of: Sequence[Hypothesis]) -> Markup | None:
    """Sentence, formula and fingerprint of every effect that is linked to."""
    known = [h.effect for h in of if h.effect in EFFECTS]
    if not known:
        return None
    notes = tag("div", map(_note, known), class_="effect-notes")
    return section("The effects named here", notes)


def _note(name: str) -> Markup:
    effect = EFFECTS[name]
    mark = effect.fingerprint
    where = f"{name_of(mark.channel)} over {name_of(mark.covariate)}: {mark.sentence}"

    return tag(
        "div",
        tag("p", tag("b", name_of(name)), f". {effect.sentence()}"),
        tag("pre", effect.formula()),
        tag("p", sentence(where), class_="note"),
        id=anchor(name),
        class_="effect-note",
    )
