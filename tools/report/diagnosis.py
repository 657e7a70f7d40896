"""The report of a diagnosis: verdict first, then the pictures, then the tables, then what it takes to redo it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from tools.diagnose.result import Diagnosis, Location, Quantity, Scatter, SoilFit, Trace
from tools.report import figures, hypotheses, redo
from tools.report.html import Child, Markup, page, section, table, tag
from tools.report.words import (
    NOTHING,
    counted,
    covariate_shown,
    held,
    listed,
    name_of,
    nats,
    number,
    percent,
    probability,
    quantity,
    sentence,
    shown,
)

VERDICTS = {  # verdict -> its name, and what it means
    "consistent": ("Consistent", "Model and recordings agree within the noise."),
    "explained": ("Explained", "Model and recordings differ, and listed physics explains it."),
    "unlisted": ("Not in the list", "Model and recordings differ, and no listed effect explains it."),
    "insufficient": ("Not decided", "These recordings cannot tell."),
}
UNITS = {"time": "s", "position": "m", "wheel_angle": "rad"}  # of places where a misfit starts or stops
NOISE_SIZES = ("sigma", "configured", "configured_sigma")
HELD_OUT = (
    "Every run is predicted by a fit to the other runs; none of its own samples were used. Under each run: recorded "
    "less simulated, with ± 2σ of the noise as a band. Grey stretches were not compared: standstill, lifted, unsteady."
)
LOCATED_RUNS, OTHER_RUNS = 6, 3  # pictures in view of a channel where the misfit lives, and of another
STRAINED = 2.0  # [σ] a soil parameter this far from what was known is worth a sentence


def write(path: Path, found: Diagnosis) -> None:
    """Raises OSError."""
    path.write_text(render(found), encoding="utf-8")


def render(found: Diagnosis) -> str:
    """The whole document."""
    return page(
        f"gritd diagnosis: {VERDICTS[found.verdict][0].lower()}",
        _verdict(found),
        _simulation(found),
        _misfit(found),
        _hypotheses(found),
        _soil(found),
        _parameters(found),
        _location(found),
        _errors(found),
        _law(found),
        _caveats(found),
        _next(found),
        _redo(found),
    )


def paragraph(*content: Child) -> Markup:
    return tag("p", *content)


# ---- verdict -------------------------------------------------------------------------------------------------------


def _verdict(found: Diagnosis) -> Markup:
    name, meaning = VERDICTS[found.verdict]
    title = f"{name}: {explanation(found)}" if found.verdict == "explained" and found.accepted else name
    runs = list(dict.fromkeys(trace.run for trace in found.traces))
    return tag(
        "header",
        tag("p", f"gritd diagnose · {counted(len(runs), 'run')}", class_="kicker"),
        tag("h1", title, tag("span", meaning)),
        tag("p", held(found.summary), class_="summary"),
        tag("dl", (_figure(*figure) for figure in _figures(found)), class_="figures"),
        class_=f"verdict {found.verdict}",
    )


def explanation(found: Diagnosis) -> str:
    """What makes the difference between before and after, in words."""
    names = [name_of(h.effect) for h in found.accepted]
    return listed(names) if names else "the empirical law" if found.law else "it"


def _figure(term: str, value: str, detail: str) -> Markup:
    return tag(
        "div", tag("dt", term), tag("dd", held(value)), tag("dd", held(detail), class_="detail") if detail else None
    )


def _figures(found: Diagnosis) -> Iterator[tuple[str, str, str]]:
    """The few numbers a hurried reader takes away: what, how much, beside what."""
    test = found.test
    alarm = f"alarm above {nats(test.threshold)}; p {probability(test.p)}"
    yield "evidence of a mismatch", nats(test.statistic), alarm
    for h in found.accepted:
        said = ", ".join(f"{name_of(name)} {quantity(q)}" for name, q in h.parameters.items())
        yield name_of(h.effect), f"{percent(h.probability)} probable", said
    channel = _most_improved(found)
    if channel:
        change, floor = _change(found, channel)
        yield f"{name_of(channel)} error, held out", change, f"noise {floor}"
    for key in ("c", "tan_phi"):
        if found.soil is not None and key in found.soil.after:
            yield name_of(key), quantity(found.soil.after[key]), _without(found.soil, key)


def _without(soil: SoilFit, key: str) -> str:
    known = f"known before {quantity(soil.prior.get(key))}"
    return known if soil.before == soil.after else f"{quantity(soil.before.get(key))} without; {known}"


def _most_improved(found: Diagnosis) -> str | None:
    """The channel whose held-out error fell most, as a share."""
    fit = found.fit
    known = [c for c in fit.before if c in fit.after and fit.before[c] > 0.0]
    return min(known, key=lambda c: fit.after[c] / fit.before[c]) if known else None


def _change(found: Diagnosis, channel: str) -> tuple[str, str]:
    """Held-out error before and after, and the noise floor, with their unit."""
    unit, factor = shown(found.fit.unit.get(channel, ""))
    before, after = (number(side[channel] * factor, 2) for side in (found.fit.before, found.fit.after))
    floor = number(_times(found.fit.noise_floor.get(channel), factor), 2)
    change = before if before == after else f"{before} → {after}"
    return f"{change} {unit}".rstrip(), f"{floor} {unit}".rstrip()


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


# ---- pictures ------------------------------------------------------------------------------------------------------


def _simulation(found: Diagnosis) -> Markup | None:
    if not found.traces:
        return None
    channels = sorted({t.channel for t in found.traces}, key=[t.channel for t in found.traces].index)
    drawn = [_channel(found, channel) for channel in channels]
    return section("Simulation against recording", paragraph(HELD_OUT), drawn)


def _channel(found: Diagnosis, channel: str) -> Markup:
    """All runs of a channel; more of them in view where the misfit lives."""
    of = [trace for trace in found.traces if trace.channel == channel]
    caption = f"{name_of(channel).capitalize()} of every run."
    if channel in found.fit.before and channel in found.fit.after:
        change, floor = _change(found, channel)
        caption = f"{name_of(channel).capitalize()}. Error over all runs {change}; noise {floor}."
    most = LOCATED_RUNS if any(place.channel == channel for place in found.location) else OTHER_RUNS
    key = figures.legend({"measured": "recorded", **_series(found, of), "unused": "not compared"})
    return figures.figure(caption, figures.traces(of, most), legend=key)


def _series(found: Diagnosis, of: Sequence[Trace]) -> dict[str, str]:
    if not any(figures.differs(trace) for trace in of):
        return {"before": "simulated"}
    name = explanation(found)
    return {"before": f"simulated without {name}", "after": f"simulated with {name}"}


def _misfit(found: Diagnosis) -> Markup | None:
    if not found.scatters:
        return None
    title = "Where the misfit lives" if found.verdict != "consistent" else "What is left"
    return section(title, (_scatter(found, scatter) for scatter in found.scatters))


def _scatter(found: Diagnosis, scatter: Scatter) -> Markup:
    here = (scatter.channel, scatter.covariate)
    words = [place.where for place in found.location if (place.channel, place.covariate) == here]
    about = f"Residual of {name_of(scatter.channel)} against {name_of(scatter.covariate)}"
    key = figures.legend({"mean": "mean in bins", "band": "± 2σ of the noise"})
    caption = f"{about}. {sentence(words[0])}" if words else f"{about}."
    return figures.figure(caption, figures.scatter(scatter, explanation(found)), legend=key, small=True)


def _hypotheses(found: Diagnosis) -> Markup | None:
    if not found.hypotheses:
        return None
    title = "What was left out" if found.accepted else "What was tried"
    return section(title, paragraph(hypotheses.introduction(found)), hypotheses.groups(found.hypotheses))


def _soil(found: Diagnosis) -> Markup | None:
    if found.soil is None:
        return None
    legend = {"prior": "known before", **_fitted(found)}
    caption = f"Soil, ± 1σ thick and ± 2σ thin. {_strain(found.soil.strain)}"
    drawn = figures.figure(caption, figures.soil(found.soil), legend=figures.legend(legend), small=True)
    return section("The soil", drawn)


def _fitted(found: Diagnosis) -> dict[str, str]:
    if found.soil is None or found.soil.before == found.soil.after:
        return {"after": "fitted"}
    return {"before": f"fitted without {explanation(found)}", "after": f"fitted with {explanation(found)}"}


def _strain(strain: Mapping[str, float]) -> str:
    """Which parameters had to leave what was known of them, where the effect is not modelled."""
    far = [f"{name_of(k)} by {number(s, 2)} σ" for k, s in strain.items() if math.isfinite(s) and abs(s) >= STRAINED]
    if not far:
        return f"Without an effect no parameter is further than {STRAINED:g} σ from what was known before."
    return f"Without an effect the fit moves {listed(far)} away from what was known before."


# ---- tables --------------------------------------------------------------------------------------------------------


def _parameters(found: Diagnosis) -> Markup | None:
    parameters = [(h.effect, name, q) for h in found.accepted for name, q in h.parameters.items()]
    parameters += [("calibration", name, q) for name, q in _strayed(found.nuisance).items()]
    rows = [(f"{name_of(of)}: {name_of(name)}", quantity(q)) for of, name, q in parameters]
    if not rows:
        return None
    return section("Parameters", table(("parameter", "value ± 1σ"), rows, numbers=1))


def _strayed(nuisance: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Calibration constants that moved by more than their own uncertainty."""
    return {name: q for name, q in nuisance.items() if q.sigma > 0.0 and abs(q.value) > q.sigma}


def _location(found: Diagnosis) -> Markup | None:
    if not found.location:
        return None
    rows = [
        (name_of(p.channel), name_of(p.covariate), _words(found, p), percent(p.share), probability(p.q))
        for p in found.location
    ]
    head = ("channel", "against", "in words", "share", "q")
    note = "Share: the part of the channel's explainable misfit. q: false-discovery rate over all pairs tried."
    return section("Where, in words", table(head, rows, numbers=3), tag("p", note, class_="note"))


def _words(found: Diagnosis, place: Location) -> str:
    """The sentence, and where the misfit starts or stops."""
    if not place.changes:
        return sentence(place.where)
    drawn = (s.covariate_unit for s in found.scatters if s.covariate == place.covariate)
    unit, factor = covariate_shown(place.covariate, next(drawn, UNITS.get(place.covariate, "")))
    changes = [_with_unit(change * factor, unit) for change in place.changes]
    return f"{sentence(place.where)} Changes at {listed(changes)}."


def _errors(found: Diagnosis) -> Markup | None:
    fit = found.fit
    if not fit.before:
        return None
    innovations = fit.innovation_before is not None or fit.innovation_after is not None
    head = ["channel", "without", "with", "noise floor", "with ÷ floor", *(["innovations"] if innovations else [])]
    rows = []
    for channel, before in fit.before.items():
        unit, factor = shown(fit.unit.get(channel, ""))
        after, floor = fit.after.get(channel), fit.noise_floor.get(channel)
        values = (_with_unit(_times(v, factor), unit) for v in (before, after, floor))
        ratio = after / floor if after is not None and floor else None
        innovation = [_innovation(found, channel)] if innovations else []
        rows.append((name_of(channel), *values, number(ratio, 2), *innovation))
    notes = [paragraph("Root mean square errors on data the fit did not see.")]
    if innovations:
        notes.append(paragraph("Innovations: of the on-line filter, over their stated σ, without → with; 1 is honest."))
    if found.remaining:
        notes.append(paragraph(sentence(found.remaining)))
    return section("Held-out errors", table(head, rows, numbers=1), tag("div", notes, class_="note"))


def _with_unit(value: float | None, unit: str) -> str:
    said = number(value)
    return said if said == NOTHING else f"{said} {unit}".rstrip()


def _innovation(found: Diagnosis, channel: str) -> str:
    sides = (found.fit.innovation_before, found.fit.innovation_after)
    said = [number((side or {}).get(channel), 2) for side in sides]
    return NOTHING if said == [NOTHING, NOTHING] else " → ".join(said)


def _law(found: Diagnosis) -> Markup | None:
    law = found.law
    if law is None:
        return None
    domain = [(name_of(name), f"{number(low)} … {number(high)}") for name, (low, high) in law.domain.items()]
    values = [(name_of(name), quantity(q)) for name, q in law.parameters.items()]
    return section(
        "An empirical law",
        paragraph(
            f"No listed effect stands behind it. It takes {percent(law.share)} of the explainable misfit of "
            f"{name_of(law.channel)}, and holds only inside its domain."
        ),
        tag("p", law.expression, class_="law"),
        table(("domain", "from … to"), domain, numbers=1) if domain else None,
        table(("parameter", "value ± 1σ"), values, numbers=1) if values else None,
    )


# ---- the end -------------------------------------------------------------------------------------------------------


def _caveats(found: Diagnosis) -> Markup | None:
    said = list(found.caveats)
    if found.baseline:
        said.insert(0, f"The configuration already models {listed([name_of(b) for b in found.baseline])}")
    return section("Caveats", tag("ul", (tag("li", sentence(c)) for c in said))) if said else None


def _next(found: Diagnosis) -> Markup | None:
    following = found.next_experiment
    if following is None:
        return None
    told = f"It would tell {listed([name_of(n) for n in following.separates])} apart" if following.separates else "It"
    gain = f"{told}; expected gain {nats(following.expected_gain_nats)}."
    return tag(
        "section",
        tag("h2", "Next experiment"),
        tag("p", sentence(following.action), class_="summary"),
        paragraph(gain if following.separates else f"Expected gain {nats(following.expected_gain_nats)}."),
        class_="next",
    )


def _redo(found: Diagnosis) -> Markup:
    noise = [(name_of(channel), _noise(found, channel, values)) for channel, values in found.noise.items()]
    noise_table = table(("noise of", "found in the recordings"), noise) if noise else None
    return section("To redo it", redo.content(found.redo), noise_table)


def _noise(found: Diagnosis, channel: str, values: Mapping[str, float]) -> str:
    """Sizes are in the channel's unit, times in seconds."""
    size = shown(found.fit.unit.get(channel, ""))
    said = []
    for key, value in values.items():
        unit, factor = ("s", 1.0) if "time" in key else size if key in NOISE_SIZES else ("", 1.0)
        said.append(f"{name_of(key)} {_with_unit(value * factor, unit)}")
    return ", ".join(said)
