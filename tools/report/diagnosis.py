"""The report of a diagnosis: verdict first, then the pictures, then the tables, then what it takes
to redo it.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from gritd.tools.cli.wording import listed, number, percent, shown, spaced
from gritd.tools.diagnose.explain.result import (
    Diagnosis,
    Hypothesis,
    Scatter,
    SoilFit,
    Trace,
)
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.report import effect_notes, figures, hypotheses, record, redo, tables
from gritd.tools.report.html import Child, Markup, page, section, table, tag
from gritd.tools.report.words import (
    counted,
    held,
    name_of,
    nats,
    probability,
    quantity,
    sentence,
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
NOISE_SIZES = ("sigma", "configured", "configured_sigma")
RUNS = "runs"  # of what it takes to redo it: the table of runs
FEW = 3  # runs; of fewer, thirds are held out
RUNS_HELD = "Every run is predicted by a fit to the other runs: none of its own samples were used."
THIRDS_HELD = (
    "Every third of a run is predicted by a fit to the rest: none of its own samples were used."
)
DRAWN = (
    "Under each run: recorded less simulated, with ± 2σ of the noise as a band. Grey "
    "stretches were not compared: standstill, lifted, unsteady."
)
LOCATED_RUNS, OTHER_RUNS = (
    6,
    3,
)  # pictures in view of a channel where the misfit lives, and of another


def write(diagnosis: Diagnosis, path: Path) -> None:
    """Raises OSError."""
    path.write_text(render(diagnosis, path.name), encoding="utf-8")


def render(diagnosis: Diagnosis, name: str = "report.html") -> str:
    """The whole document; name: of the file it will be."""
    return page(
        f"gritd diagnosis: {VERDICTS[diagnosis.verdict][0].lower()}",
        _verdict(diagnosis),
        _runs(diagnosis),
        _simulation(diagnosis),
        _misfit(diagnosis),
        _hypotheses(diagnosis),
        _soil(diagnosis),
        tables.parameters(diagnosis),
        tables.location(diagnosis),
        tables.held_out(diagnosis),
        tables.law(diagnosis),
        _caveats(diagnosis),
        _next(diagnosis),
        _redo(diagnosis, name),
        effect_notes.notes(hypotheses.named(diagnosis.hypotheses)),
    )


def paragraph(*content: Child) -> Markup:
    return tag("p", *content)


# --- verdict ---


def _verdict(diagnosis: Diagnosis) -> Markup:
    name, meaning = VERDICTS[diagnosis.verdict]
    effects = [_or_alike(h) for h in diagnosis.accepted]
    title = f"{name}: {listed(effects)}" if diagnosis.verdict == "explained" and effects else name

    runs = {trace.run for trace in diagnosis.traces}

    return tag(
        "header",
        tag("p", f"gritd diagnose · {counted(len(runs), 'run')}", class_="kicker"),
        tag("h1", title, tag("span", meaning)),
        tag("p", held(tables.named(diagnosis, diagnosis.summary)), class_="summary"),
        tag("dl", (_figure(*figure) for figure in _figures(diagnosis)), class_="figures"),
        class_=f"verdict {diagnosis.verdict}",
    )


def _runs(diagnosis: Diagnosis) -> Markup | None:
    """What was driven, and what was noted of it."""
    runs = diagnosis.redo.get(RUNS)
    if not runs:
        return None
    head = [name for name in runs[0] if name != "notes"]
    remarks = [tag("li", f"{run['run']}: {run['notes']}") for run in runs if run.get("notes")]
    rows = ([run[name] for name in head] for run in runs)
    return section("Runs", table(head, rows), tag("ul", remarks) if remarks else None)


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
    """An effect's name, and how many others the recordings cannot tell it from."""
    others = len(h.indistinguishable_from)
    rivals = (
        f" or {name_of(h.indistinguishable_from[0])}"
        if others == 1
        else f" or one of {others} like it"
    )
    return name_of(h.effect) + (rivals if others else "")


def _together(diagnosis: Diagnosis, h: Hypothesis) -> float:
    """Probability that it is this effect or one like it."""
    group = {h.effect, *h.indistinguishable_from}
    return min(
        sum(other.probability for other in diagnosis.hypotheses if other.effect in group), 1.0
    )


def _figure(term: str, value: str, detail: str) -> Markup:
    return tag(
        "div",
        tag("dt", term),
        tag("dd", held(value)),
        tag("dd", held(detail), class_="detail") if detail else None,
    )


def _figures(diagnosis: Diagnosis) -> Iterator[tuple[str, str, str]]:
    """The few numbers a hurried reader takes away: what, how much, beside what."""
    test = diagnosis.test
    alarm = f"alarm above {nats(test.threshold)}; p {probability(test.p)}"
    yield "evidence of a mismatch", nats(test.statistic), alarm

    for h in diagnosis.accepted:
        parameters = [f"{name_of(name)} {quantity(q)}" for name, q in h.parameters.items()]
        if h.indistinguishable_from:
            parameters.append(f"together with its like {percent(_together(diagnosis, h))}")
        yield name_of(h.effect), f"{percent(h.probability)} probable", "; ".join(parameters)

    channel = _most_improved(diagnosis)
    if channel:
        change, floor = _change(diagnosis, channel)
        yield f"{name_of(channel)} error, held out", change, f"noise {floor}"

    for key in ("c", "tan_phi"):
        if diagnosis.soil is not None and key in diagnosis.soil.after:
            yield name_of(key), quantity(diagnosis.soil.after[key]), _without(diagnosis.soil, key)


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


def _change(diagnosis: Diagnosis, channel: str) -> tuple[str, str]:
    """Held-out error before and after, and the noise floor, with their unit."""
    unit = diagnosis.fit.unit.get(channel, "")
    seen, factor = shown(unit)
    before, after = (
        number(side[channel] * factor, 2) for side in (diagnosis.fit.before, diagnosis.fit.after)
    )
    change = before if before == after else f"{before} → {after}"
    return f"{change} {seen}".rstrip(), with_unit(diagnosis.fit.noise_floor.get(channel), unit, 2)


# --- pictures ---


def _simulation(diagnosis: Diagnosis) -> Markup | None:
    if not diagnosis.traces:
        return None
    runs = {trace.run for trace in diagnosis.traces}
    channels = dict.fromkeys(trace.channel for trace in diagnosis.traces)
    drawn = (
        [_one_run(diagnosis)]
        if len(runs) == 1
        else [_channel(diagnosis, channel) for channel in channels]
    )
    note = f"{RUNS_HELD if len(runs) >= FEW else THIRDS_HELD} {DRAWN}"
    return section("Simulation against recording", paragraph(note), drawn)


def _one_run(diagnosis: Diagnosis) -> Markup:
    """All its channels side by side."""
    caption = "; ".join(_error_words(diagnosis, trace.channel) for trace in diagnosis.traces)
    return figures.figure(
        sentence(caption),
        figures.channels(diagnosis.traces),
        legend=_key(diagnosis, diagnosis.traces),
    )


def _channel(diagnosis: Diagnosis, channel: str) -> Markup:
    """All runs of a channel; more of them in view where the misfit lives."""
    of = [trace for trace in diagnosis.traces if trace.channel == channel]
    most = (
        LOCATED_RUNS
        if any(place.channel == channel for place in diagnosis.location)
        else OTHER_RUNS
    )
    caption = sentence(f"{_error_words(diagnosis, channel)} over all runs")
    return figures.figure(caption, figures.traces(of, most), legend=_key(diagnosis, of))


def _error_words(diagnosis: Diagnosis, channel: str) -> str:
    """The channel with its held-out error, where one was computed."""
    if channel not in diagnosis.fit.before or channel not in diagnosis.fit.after:
        return name_of(channel)
    change, floor = _change(diagnosis, channel)
    return f"{name_of(channel)} with an error of {change} (noise {floor})"


def _key(diagnosis: Diagnosis, of: Sequence[Trace]) -> Markup:
    name = explanation(diagnosis)
    series = {"before": f"simulated without {name}", "after": f"simulated with {name}"}
    if not any(figures.differs(trace) for trace in of):
        series = {"before": "simulated"}
    return figures.legend({"measured": "recorded", **series, "unused": "not compared"})


def _misfit(diagnosis: Diagnosis) -> Markup | None:
    if not diagnosis.scatters:
        return None
    title = "Where the misfit lives" if diagnosis.verdict != "consistent" else "What is left"
    by_picture = {(s.channel, figures.drawn_against(s)): s for s in reversed(diagnosis.scatters)}
    return section(
        title, (_scatter(diagnosis, scatter) for scatter in reversed(by_picture.values()))
    )


def _scatter(diagnosis: Diagnosis, scatter: Scatter) -> Markup:
    here = (scatter.channel, scatter.covariate)
    places = [place for place in diagnosis.location if (place.channel, place.covariate) == here]

    against = figures.drawn_against(scatter)
    about = f"Residual of {name_of(scatter.channel)} against {name_of(against)}"
    if against == "run":
        about = f"Residual of {name_of(scatter.channel)} in each run, in order of time"

    changes = places[0].changes if places else ()
    marks = {"change": "starts or stops"} if changes else {}
    key = figures.legend({"mean": "mean", "band": "± 2σ of the noise", **marks})

    caption = (
        f"{about}. {sentence(tables.named(diagnosis, places[0].where))}" if places else f"{about}."
    )

    runs = list(dict.fromkeys(trace.run for trace in diagnosis.traces))
    drawn = figures.scatter(scatter, explanation(diagnosis), runs, changes)
    return figures.figure(caption, drawn, legend=key, small=True)


def _hypotheses(diagnosis: Diagnosis) -> Markup | None:
    if not diagnosis.hypotheses:
        return None
    title = "What was left out" if diagnosis.accepted else "What was tried"
    return section(
        title,
        paragraph(hypotheses.introduction(diagnosis)),
        hypotheses.groups(diagnosis.hypotheses),
    )


def _soil(diagnosis: Diagnosis) -> Markup | None:
    if diagnosis.soil is None:
        return None

    legend = {"prior": "known before", **_fitted(diagnosis)}
    strain = (
        diagnosis.soil.strained()
        or "Without an effect no parameter is"
        f" {TUNING.explain.strained_soil:g} σ from what was known before."
    )
    caption = f"Soil, ± 1σ thick and ± 2σ thin. {strain}"

    drawn = figures.figure(
        caption, figures.soil(diagnosis.soil), legend=figures.legend(legend), small=True
    )
    return section("The soil", drawn)


def _fitted(diagnosis: Diagnosis) -> dict[str, str]:
    if diagnosis.soil is None or diagnosis.soil.before == diagnosis.soil.after:
        return {"after": "fitted"}
    return {
        "before": f"fitted without {explanation(diagnosis)}",
        "after": f"fitted with {explanation(diagnosis)}",
    }


# --- the end ---


def _caveats(diagnosis: Diagnosis) -> Markup | None:
    caveats = list(diagnosis.caveats)
    if diagnosis.baseline:
        caveats.insert(
            0,
            f"The configuration already models {listed([name_of(b) for b in diagnosis.baseline])}",
        )
    return (
        section("Caveats", tag("ul", (tag("li", sentence(c)) for c in caveats)))
        if caveats
        else None
    )


def _next(diagnosis: Diagnosis) -> Markup | None:
    following = diagnosis.next_experiment
    if following is None:
        return None

    gain = f"expected gain {nats(following.expected_gain_nats)}"
    if math.isfinite(following.expected_probability):
        gain += (
            f", which takes what is true from 50 % to {percent(following.expected_probability)} "
            "against a rival"
        )
    if following.separates:
        gain = f"it would tell {listed([name_of(n) for n in following.separates])} apart; {gain}"

    return tag(
        "section",
        tag("h2", "Next experiment"),
        tag("p", sentence(following.action), class_="summary"),
        paragraph(sentence(gain))
        if math.isfinite(following.expected_gain_nats) or following.separates
        else None,
        class_="next",
    )


def _redo(diagnosis: Diagnosis, name: str) -> Markup:
    noise = [
        (name_of(channel), _noise(diagnosis, channel, values))
        for channel, values in diagnosis.noise.items()
    ]
    needed = {key: value for key, value in diagnosis.redo.items() if key != RUNS}
    noise_table = table(("noise of", "found in the recordings"), noise) if noise else None
    return section("To redo it", _again(diagnosis, name), redo.content(needed), noise_table)


def _again(diagnosis: Diagnosis, name: str) -> list[Markup] | None:
    """The command that does it again from this page, and what the command reads from it."""
    if not isinstance(diagnosis.redo.get("files"), Mapping):
        return None
    command = shlex.join(["gritd", "diagnose", "--redo", name])
    note = (
        "This page holds what it takes beside the recordings: they are checked by their hashes, "
        "and results compared."
    )
    embedded = tag("pre", record.as_json(diagnosis), id=record.EMBEDDED, hidden="hidden")
    return [paragraph(note), tag("pre", command, class_="command"), embedded]


def _noise(diagnosis: Diagnosis, channel: str, values: Mapping[str, float]) -> str:
    """Sizes are in the channel's unit, times in seconds."""
    size = shown(diagnosis.fit.unit.get(channel, ""))
    parts = []
    for key, value in values.items():
        unit, factor = ("s", 1.0) if "time" in key else size if key in NOISE_SIZES else ("", 1.0)
        parts.append(f"{name_of(key)} {spaced(value * factor, unit)}")
    return ", ".join(parts)
