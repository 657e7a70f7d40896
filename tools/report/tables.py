"""The tables of a diagnosis: parameters with units, where in words, held-out errors, the empirical
law.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from gritd.tools.cli.wording import NOTHING, covariate_shown, listed, number, percent, spaced
from gritd.tools.diagnose.explain.result import Diagnosis, Location, Quantity
from gritd.tools.diagnose.rig.constants import UNITS
from gritd.tools.report.html import Markup, section, table, tag
from gritd.tools.report.words import name_of, probability, quantity, sentence, with_unit

UNSEEN = (
    "Root mean square errors on data the fit did not see: the noise, what is still left out, "
    "and what the soil's remaining uncertainty makes of a run that was not fitted."
)
STRAYED = 2.0  # [σ]
DECADE = 10.0  # values from here on carry a third digit


def parameters(diagnosis: Diagnosis) -> Markup | None:
    parameters = [
        (h.effect, name, q) for h in diagnosis.accepted for name, q in h.parameters.items()
    ]
    parameters += [
        (h.effect, f"{name_of(channel)} from lowest to highest", q)
        for h in diagnosis.accepted
        for channel, q in h.profile.items()
    ]
    had = diagnosis.reference.effects if diagnosis.reference is not None else {}
    parameters += [
        (f"{effect} in both campaigns", name, q)
        for effect, of_both in had.items()
        for name, q in of_both.items()
    ]
    own = {n: q for n, q in diagnosis.nuisance.items() if n.partition(".")[0] not in had}
    parameters += [("calibration", name, q) for name, q in _strayed(own).items()]
    rows = [(f"{name_of(of)}: {name_of(name)}", quantity(q)) for of, name, q in parameters]
    if not rows:
        return None
    return section("Parameters", table(("parameter", "value ± 1σ"), rows, numbers=1))


def _strayed(nuisance: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Calibration constants that are not zero by more than STRAYED of their uncertainty."""
    return {
        name: q
        for name, q in nuisance.items()
        if q.sigma > 0.0 and abs(q.value) > STRAYED * q.sigma
    }


def location(diagnosis: Diagnosis) -> Markup | None:
    if not diagnosis.location:
        return None

    rows = [
        (
            name_of(p.channel),
            name_of(p.covariate),
            sentence(named(diagnosis, p.where)),
            _changes(diagnosis, p),
            probability(p.q),
        )
        for p in diagnosis.location
    ]

    head = ("channel", "against", "in words", "starts or stops at", "q")
    note = (
        "Recorded against predicted, the value's own run held out. A channel's misfit is what "
        "soil and calibration cannot take; shares overlap where covariates vary together. q: "
        "false-discovery rate over all pairs tried."
    )

    return section("Where, in words", table(head, rows, numbers=4), tag("p", note, class_="note"))


def _changes(diagnosis: Diagnosis, place: Location) -> str:
    """Values of the covariate at which the misfit starts or stops."""
    if place.covariate == "run":
        return listed([run_name(diagnosis, change) for change in place.changes])
    unit, factor = covariate_shown(place.covariate, UNITS.get(place.covariate, ""))
    return listed(
        [
            spaced(change * factor, unit, 2 if abs(change * factor) < DECADE else 3)
            for change in place.changes
        ]
    )


def run_name(diagnosis: Diagnosis, number_of: float) -> str:
    """The name of the n-th run in order of time, from 1."""
    began = {trace.run: trace.time[0] for trace in diagnosis.traces}
    names = sorted(began, key=lambda run: began[run])
    at = int(number_of) - 1 if math.isfinite(number_of) else -1
    return names[at] if 0 <= at < len(names) else f"run {number(number_of)}"


def held_out(diagnosis: Diagnosis) -> Markup | None:
    fit = diagnosis.fit
    if not fit.before:
        return None

    innovations = fit.innovation_before is not None or fit.innovation_after is not None
    sides = ["without", "with"] if fit.before != fit.after else ["error"]
    head = [
        "channel",
        *sides,
        "noise floor",
        f"{sides[-1]} ÷ floor",
        *(["innovations"] if innovations else []),
    ]

    rows = []
    for channel, before in fit.before.items():
        after, floor = fit.after.get(channel), fit.noise_floor.get(channel)
        errors = (before, after) if len(sides) == 2 else (after,)
        values = (with_unit(v, fit.unit.get(channel, "")) for v in (*errors, floor))
        ratio = after / floor if after is not None and floor else None
        innovation = [_innovation(diagnosis, channel)] if innovations else []
        rows.append((name_of(channel), *values, number(ratio, 2), *innovation))

    notes = [tag("p", UNSEEN)]
    if innovations:
        notes.append(
            tag(
                "p",
                "Innovations: of the on-line filter, over their stated σ, without → with; "
                "1 is honest.",
            )
        )
    if fit.innovation_note:
        notes.append(tag("p", fit.innovation_note))
    if diagnosis.remaining_words:
        notes.append(tag("p", sentence(named(diagnosis, diagnosis.remaining_words))))

    return section(
        "Held-out errors", table(head, rows, numbers=1), tag("div", notes, class_="note")
    )


def _innovation(diagnosis: Diagnosis, channel: str) -> str:
    sides = (diagnosis.fit.innovation_before, diagnosis.fit.innovation_after)
    values = [number((side or {}).get(channel), 2) for side in sides]
    return NOTHING if values == [NOTHING, NOTHING] else " → ".join(values)


def law(diagnosis: Diagnosis) -> Markup | None:
    law = diagnosis.law
    if law is None:
        return None

    domain = [(name_of(name), _range(name, *ends)) for name, ends in law.domain.items()]
    values = [(name_of(name), quantity(q)) for name, q in law.parameters.items()]

    return section(
        "An empirical law",
        tag(
            "p",
            f"No listed effect stands behind it. It takes {percent(law.share)} of the explainable "
            f"misfit of {name_of(law.channel)}, and holds only inside its domain.",
        ),
        tag("p", law.expression, class_="law"),
        table(("domain", "from … to"), domain, numbers=1) if domain else None,
        table(("parameter", "value ± 1σ"), values, numbers=1) if values else None,
    )


def named(diagnosis: Diagnosis, text: str) -> str:
    """Effects and channels in words instead of by their keys."""
    for key in (*(h.effect for h in diagnosis.hypotheses), *diagnosis.fit.unit):
        text = text.replace(key, name_of(key))
    return text


def _range(covariate: str, low: float, high: float) -> str:
    unit, factor = covariate_shown(covariate, UNITS.get(covariate, ""))
    return f"{number(low * factor)} … {spaced(high * factor, unit)}"
