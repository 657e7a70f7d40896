"""The report of a campaign without a diagnosis: what was driven, forces against the equations, the
estimates with their bands, and the state of the sensors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, sqrt
from typing import Any

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.filter.estimate import KPA, TAN_PHI, C, Estimate
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import honesty, listed, number, percent, spaced
from gritd.tools.report import figures, lab, masthead, plot, redo
from gritd.tools.report.html import Child, Markup, page, section, table, tag
from gritd.tools.report.lab import LabRun, MeasuredWindows, joined
from gritd.tools.report.words import counted, held, name_of, sentence, stopped, uncertain

FORCES = {"torque": ("T [N·m]", "N·m"), "drawbar_pull": ("DP [N]", "N")}  # label, unit
SOIL = {  # field -> label, factor
    "cohesion": ("c [Pa]", 1.0),
    "tan_phi": ("tan φ", 1.0),
    "shear_modulus": ("k [mm]", 1e3),
}
HEIGHT, TOP, BOTTOM = 220.0, 22.0, 182.0  # [px] of a picture and its axes
CURVE = 40  # points of a curve over slip
BAND = 2.0  # [σ] half width of a band
ELLIPSES = 5  # of one run, over its time
PANELS = 18  # of a figure in view: a printed page
KEY = {"recorded": "recorded", "before": "original, Eqs. 1–10", "after": "closed form, Eqs. 20–22"}
LATE = 5.0  # usual distances of two messages: what is farther is a gap


@dataclass(frozen=True)
class ReportedCampaign:
    """What is reported of a campaign."""

    testbed: str
    runs: Sequence[LabRun]
    redo: Mapping[str, Any]
    notes: Sequence[str] = field(default_factory=list)  # each begins with a file's name

    @property
    def estimate(self) -> Estimate:
        """What all runs know of the soil."""
        return self.runs[-1].run.known.estimate


def render(campaign: ReportedCampaign) -> str:
    """The whole document."""
    return page(
        f"gritd report: {campaign.testbed}",
        _title(campaign),
        masthead.runs(lab.records_of(campaign.runs)),
        _forces(campaign),
        _estimates(campaign),
        _ellipses(campaign),
        _sensors(campaign),
        _notes(campaign),
        section("To redo it", redo.content(campaign.redo), class_="appendix"),
        redo.appendix(campaign.redo),
    )


# --- the first page ---


def _title(campaign: ReportedCampaign) -> Markup:
    count = counted(len(campaign.runs), "run")
    return tag(
        "header",
        tag("p", f"gritd report · {campaign.testbed} · {count}", class_="kicker"),
        tag("h1", campaign.testbed),
        tag("p", held(_summary(campaign)), class_="summary"),
        masthead.masthead(campaign.testbed, lab.records_of(campaign.runs)),
        class_="verdict explained",
    )


def _summary(campaign: ReportedCampaign) -> str:
    """Soil, and how far both forms of the equations are off."""
    x, P = campaign.estimate.x, campaign.estimate.soil_P
    c, tan_phi = (x[i] for i in (C, TAN_PHI))
    sigma_c, sigma_t = (sqrt(P[i][i]) for i in (C, TAN_PHI))
    together = "together know" if len(campaign.runs) > 1 else "knows"
    soil = (
        f"{counted(len(campaign.runs), 'run')} {together} the soil as "
        f"c {uncertain(c * KPA, sigma_c * KPA)} Pa, tan φ {uncertain(tan_phi, sigma_t)}."
    )
    return f"{soil} {_differences(campaign)}".strip()


def _differences(campaign: ReportedCampaign) -> str:
    """Of both forms from what was measured, over the windows of all runs."""
    every = [run.windows for run in campaign.runs if run.windows is not None]
    if not every:
        return ""
    of = joined(every)
    parts = [
        f"{label.split(' ')[0]} differs by {spaced(of.off(channel, 'original'), unit, 2)} from the "
        f"original equations and by {spaced(of.off(channel, 'closed'), unit, 2)} from the closed "
        f"form, of which {spaced(of.noise(channel), unit, 2)} is noise"
        for channel, (label, unit) in FORCES.items()
        if isfinite(of.off(channel, "original"))
    ]
    return " ".join(map(sentence, parts))


# --- forces ---


def _forces(campaign: ReportedCampaign) -> Markup | None:
    of = [run for run in campaign.runs if run.windows is not None]
    if not of:
        return None
    note = (
        "Both forms at the measured entry angle, slip and load, with the soil that the runs "
        f"together know and {_effects(of)}. Next to each load stand the root mean square "
        "differences from what was measured."
    )
    return section("Drawbar pull and torque against slip", tag("p", note), _drawn_forces(of))


def _drawn_forces(of: Sequence[LabRun]) -> Iterator[Markup]:
    """A panel for each load of each run."""
    parts = [
        (f"{run.name}, {np.mean(part.load):.0f} N", part)
        for run in of
        if run.windows is not None
        for part in run.windows.by_load()
    ]

    for channel, (label, unit) in FORCES.items():
        drawn = [
            (
                part.off(channel, "original"),
                figures.panel(name, _over_slip(part, channel, label), _errors(part, channel, unit)),
            )
            for name, part in parts
            if isfinite(part.off(channel, "original"))
        ]

        if drawn:
            name = label.split(" ")[0]
            caption = f"{name} against slip, original and closed form against what was recorded."
            legend = figures.legend(KEY)
            yield figures.figure(caption, *_in_view(drawn), legend=legend, whole=True)


def _in_view(drawn: Sequence[tuple[float, Markup]]) -> Iterator[Markup]:
    """Panels in their order. Of more than a page holds, those that differ most are in view and
    printed; the others are folded.
    """
    order = sorted(range(len(drawn)), key=lambda at: -drawn[at][0])
    chosen, rest = (sorted(some) for some in (order[:PANELS], order[PANELS:]))
    yield figures.panels(drawn[at][1] for at in chosen)
    if rest:
        summary = tag("summary", f"{counted(len(rest), 'more load')}, with smaller differences")
        folded = figures.panels(drawn[at][1] for at in rest)
        yield tag("details", summary, folded, class_="unprinted")


def _errors(part: MeasuredWindows, channel: str, unit: str) -> str:
    """How far both forms are off."""
    off = (f"{which} {number(part.off(channel, which), 2)}" for which in ("original", "closed"))
    return f"{', '.join(off)} {unit}"


def _effects(of: Sequence[LabRun]) -> str:
    """What the configuration adds to both forms."""
    settings = of[0].run.settings
    names = [name_of(e.name) for e in settings.effects if not EFFECTS[e.name].filter_only]
    names += ["learnt form error"] if settings.discrepancy is not None else []
    return f"the configured {listed(names)}" if names else "no effects"


def _over_slip(of: MeasuredWindows, channel: str, label: str) -> Markup:
    """Recorded windows as dots, both forms as curves of their means over slip."""
    slip, measured = of.slip * 100.0, of.measured[channel]
    computed = {"before": of.original[channel], "after": of.closed[channel]}
    at = plot.axes(plot.limits(slip), plot.limits(measured, *computed.values()), TOP, BOTTOM)

    curves = [
        plot.line(at, *mean_over(slip, values), f"line {kind}") for kind, values in computed.items()
    ]

    frame = plot.frame(at, label, below="slip [%]")
    dots = plot.dots(at, slip, measured, "dots recorded")
    return plot.picture(HEIGHT, f"{label} against slip", frame, *curves, dots)


def mean_over(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of y (n,) in bins of x, at the bins' mean x."""
    edges = np.linspace(np.min(x), np.max(x), CURVE + 1)
    which = np.clip(np.digitize(x, edges) - 1, 0, CURVE - 1)
    filled = [at for at in range(CURVE) if np.any(which == at)]
    means = [(np.mean(x[which == at]), np.mean(y[which == at])) for at in filled]
    xs, ys = np.array(means).T
    return xs, ys


# --- estimates ---


def _estimates(campaign: ReportedCampaign) -> Markup:
    note = (
        "Each run begins with what the runs before it know. The band is ± 2σ."
        if len(campaign.runs) > 1
        else "The band is ± 2σ."
    )

    panels = (
        figures.panel(label, _over_time(campaign, name, label, factor))
        for name, (label, factor) in SOIL.items()
    )

    caption = "Cohesion, tan φ and shear modulus over the time of all runs, one after the other."
    return section(
        "The estimates", tag("p", note), figures.figure(caption, figures.panels(panels), small=True)
    )


def _over_time(campaign: ReportedCampaign, name: str, label: str, factor: float) -> Markup:
    """Value and band over the driven time of all runs."""
    value = np.concatenate([run.rows[name] for run in campaign.runs]) * factor
    sigma = np.concatenate([run.rows[f"{name}_sigma"] for run in campaign.runs]) * factor
    time, begins = _time(campaign)

    low, high = value - BAND * sigma, value + BAND * sigma
    at = plot.axes(plot.limits(time), plot.limits(low, high), TOP, BOTTOM)
    return plot.picture(
        HEIGHT,
        f"{label} over time",
        plot.frame(at, label, below="time [s]"),
        plot.uprights(at, begins[1:], "change"),
        plot.ribbon(at, time, low, high, "ribbon after"),
        plot.line(at, time, value, "line after"),
    )


def _time(campaign: ReportedCampaign) -> tuple[Array, list[float]]:
    """Time [s] of every window, the runs one after the other, and where each begins."""
    pieces, begins, passed = [], [], 0.0
    for run in campaign.runs:
        stamps = run.rows["evaluated"]
        time = (stamps - stamps[0]) * lab.NS if len(stamps) else np.zeros(0)
        begins.append(passed)
        pieces.append(time + passed)
        passed += float(time[-1]) if len(time) else 0.0
    return np.concatenate(pieces), begins


def _ellipses(campaign: ReportedCampaign) -> Markup:
    """2σ ellipses of c and tan φ: some of each run, and the last."""
    chosen = [
        _outline(row)
        for run in campaign.runs
        for row in run.rows[np.linspace(0, len(run.rows) - 1, ELLIPSES).astype(int)]
    ]

    last = chosen.pop()
    at = plot.axes(
        plot.limits(*(c for c, _ in chosen), last[0]),
        plot.limits(*(t for _, t in chosen), last[1]),
        TOP,
        BOTTOM,
    )

    drawn = [plot.line(at, *outline, "line thin prior") for outline in chosen]
    picture = plot.picture(
        HEIGHT,
        "ellipses of c and tan φ",
        plot.frame(at, "tan φ", below="c [Pa]"),
        *drawn,
        plot.line(at, *last, "line ribbon after"),
    )

    key = figures.legend({"prior": "on the way", "after": "at the end"})
    caption = "What is known of c and tan φ together: ellipses of 2σ over the time of all runs."
    panel = figures.panels([figures.panel("c and tan φ", picture)])
    return section(
        "Cohesion and friction together", figures.figure(caption, panel, legend=key, small=True)
    )


def _outline(row: np.void) -> tuple[Array, Array]:
    """The 2σ ellipse of c [Pa] and tan φ at one window."""
    covariance = np.array(
        [
            [row["cohesion_sigma"] ** 2, row["cov_c_tan_phi"]],
            [row["cov_c_tan_phi"], row["tan_phi_sigma"] ** 2],
        ]
    )

    scale = np.sqrt(np.diag(covariance)) + 1e-300
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    angle = np.linspace(0.0, 2.0 * np.pi, 61)
    circle = np.vstack([np.cos(angle), np.sin(angle)])
    ring = (vectors * np.sqrt(np.maximum(values, 0.0))) @ circle * scale[:, None]

    return row["cohesion"] + BAND * ring[0], row["tan_phi"] + BAND * ring[1]


# --- sensors ---


def _sensors(campaign: ReportedCampaign) -> Markup:
    """Rate, gaps and longest silence of every channel, over all runs; what the filter said."""
    lines = [
        tag(
            "li",
            f"{run.name}: updated in {percent(_tracked(run))} of its windows, "
            f"{honesty(float(run.rows['consistency'][-1]))}{_lateness(run)}",
        )
        for run in campaign.runs
    ]

    head = ("channel", "runs", "rate [Hz]", "gaps", "longest [ms]")
    note = f"A gap is more than {LATE:g} times the usual distance of two readings."
    return section(
        "The sensors and the filter",
        tag("ul", lines),
        table(head, _channels(campaign.runs), numbers=2),
        tag("p", note, class_="note"),
    )


def _channels(runs: Sequence[LabRun]) -> list[list[str]]:
    """A row for each channel, and for each state of it that runs have in common."""
    alike: dict[tuple[str, ...], list[str]] = {}

    for run in runs:
        for topic in run.summary.topics:
            name = topic.topic.removeprefix("/raw/")
            if name != topic.topic:
                longest = f"{topic.longest * 1e3:.0f}"
                state = (name, f"{topic.rate:.4g}", str(topic.gaps), longest)
                alike.setdefault(state, []).append(run.name)

    return [
        [state[0], "all" if len(names) == len(runs) else ", ".join(names), *state[1:]]
        for state, names in sorted(alike.items())
    ]


def _tracked(run: LabRun) -> float:
    return 0.0 if run.windows is None else len(run.windows.slip) / max(len(run.rows), 1)


def _lateness(run: LabRun) -> str:
    """Of the daemon's loop, where it was recorded."""
    recording = run.run.recording
    if not recording.counts["/loop"]:
        return ""
    late = np.quantile(recording.arrays("/loop")["lateness"], (0.99, 1.0)) * 1e3
    return f", ticks late by {late[0]:.2f} ms (99 %), {late[1]:.2f} ms (max)"


def _notes(campaign: ReportedCampaign) -> Child:
    if not campaign.notes:
        return None
    return section("Notes", tag("ul", (tag("li", stopped(note)) for note in campaign.notes)))
