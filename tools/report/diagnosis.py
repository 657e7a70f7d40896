"""The report of a diagnosis: verdict first, then the pictures, then the tables, then what it takes
to redo it.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from gritd.tools.cli.wording import listed, percent, shown, spaced
from gritd.tools.diagnose.explain.result import (
    Diagnosis,
    Scatter,
    Trace,
)
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.report import (
    figures,
    front,
    hypotheses,
    record,
    redo,
    side_by_side,
    tables,
)
from gritd.tools.report.html import Child, Markup, page, section, table, tag
from gritd.tools.report.words import (
    name_of,
    nats,
    sentence,
    to_tell,
)

NOISE_SIZES = ("sigma", "configured", "configured_sigma")
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
        f"gritd diagnosis: {front.VERDICTS[diagnosis.verdict][0].lower()}",
        front.verdict(diagnosis),
        front.runs(diagnosis),
        _simulation(diagnosis),
        side_by_side.campaigns(diagnosis),
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
        redo.appendix(diagnosis.redo),
    )


def paragraph(*content: Child) -> Markup:
    return tag("p", *content)


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
    change, floor = front.change(diagnosis, channel)
    return f"{name_of(channel)} with an error of {change} (noise {floor})"


def _key(diagnosis: Diagnosis, of: Sequence[Trace]) -> Markup:
    name = front.explanation(diagnosis)
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
    drawn = figures.scatter(scatter, front.explanation(diagnosis), runs, changes)
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
        "before": f"fitted without {front.explanation(diagnosis)}",
        "after": f"fitted with {front.explanation(diagnosis)}",
    }


# --- the end ---


def _caveats(diagnosis: Diagnosis) -> Markup | None:
    caveats = list(diagnosis.caveats)

    if diagnosis.baseline:
        caveats.insert(
            0,
            f"The configuration already models {listed([name_of(b) for b in diagnosis.baseline])}",
        )
    if diagnosis.reference is not None and diagnosis.reference.effects:
        had = listed([name_of(effect) for effect in diagnosis.reference.effects])
        caveats.insert(
            0, f"The reference shows {had} by itself, and both campaigns are fitted with it"
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
        names = [name_of(n) for n in following.separates]
        gain = f"{to_tell(diagnosis.verdict, names)}; {gain}"

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
    needed = {k: v for k, v in diagnosis.redo.items() if k not in (front.RUNS, front.RIG)}
    noise_table = table(("noise of", "found in the recordings"), noise) if noise else None

    return section(
        "To redo it",
        _again(diagnosis, name),
        redo.content(needed),
        noise_table,
        class_="appendix",
    )


def _again(diagnosis: Diagnosis, name: str) -> list[Markup] | None:
    """The command that does it again from this page, and what the command reads from it."""
    if not isinstance(diagnosis.redo.get("files"), Mapping):
        return None
    command = shlex.join(["gritd", "diagnose", "--redo", name])
    note = (
        "This page holds what it takes besides the recordings: they are checked by their hashes, "
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
