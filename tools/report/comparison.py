"""Simulation over recording without a diagnosis: as configured and, where asked for, with the soil
fitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gritd.estimator.visible import visible
from gritd.tools.cli.wording import listed, number, shown
from gritd.tools.diagnose.explain.result import SoilFit, Trace
from gritd.tools.report import figures, redo
from gritd.tools.report.html import Markup, page, section, table, tag
from gritd.tools.report.words import counted, held, name_of, quantity, sentence

ALL = "all runs"
KEY = {
    "measured": "recorded",
    "before": "simulated as configured",
    "after": "simulated, soil fitted",
}
NOTE = (
    "The original equations, driven by the recorded motion and the known load. Under a run: "
    "recorded less simulated, with ± 2σ of the noise as a band. Grey stretches are not in the "
    "errors: standstill, lifted, unsteady."
)


@dataclass(frozen=True)
class Comparison:
    """Traces by channel, then run: `before` as configured, `after` with the soil fitted (the same
    where it was not).

    soil: known and fitted, None without a fit.
    """

    testbed: str
    traces: tuple[Trace, ...]
    soil: SoilFit | None
    baseline: tuple[str, ...]  # effects of the configuration
    caveats: tuple[str, ...]
    redo: Mapping[str, Any]
    damage: tuple[str, ...] = ()  # of the recordings

    @property
    def notes(self) -> list[str]:
        return [*self.caveats, *(f"Damaged: {line}" for line in self.damage)]

    @property
    def channels(self) -> list[str]:
        return list(dict.fromkeys(trace.channel for trace in self.traces))

    @property
    def runs(self) -> list[str]:
        return list(dict.fromkeys(trace.run for trace in self.traces))

    def rms(self, channel: str, run: str | None, which: str) -> float:
        """Root mean square residual [the channel's unit] of a run, or of all; NaN where nothing was
        compared.
        """
        of = [t for t in self.traces if t.channel == channel and run in (None, t.run)]
        counts = np.array([sum(t.used) for t in of], dtype=float)
        squares = np.nan_to_num([figures.rms(t, which) ** 2 for t in of])
        total = counts.sum()
        return float(np.sqrt(counts @ squares / total)) if total else float("nan")

    def errors(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows of the table of errors: a row a run and one for all, in the units shown."""
        units = {channel: shown(_unit(self.traces, channel)) for channel in self.channels}
        head = [
            "run",
            *(f"{name_of(channel)} [{unit or '–'}]" for channel, (unit, _) in units.items()),
        ]

        runs: list[tuple[str, str | None]] = [(run, run) for run in self.runs]
        rows = runs + ([(ALL, None)] if len(runs) > 1 else [])
        return head, [
            [label, *(self._error(c, run, units[c][1]) for c in self.channels)]
            for label, run in rows
        ]

    def _error(self, channel: str, run: str | None, factor: float) -> str:
        sides = ("before", "after") if self.soil else ("before",)
        return " → ".join(number(self.rms(channel, run, which) * factor, 3) for which in sides)


def _unit(traces: Sequence[Trace], channel: str) -> str:
    return next(trace.unit for trace in traces if trace.channel == channel)


def render(comparison: Comparison) -> str:
    """The whole document."""
    head, rows = comparison.errors()
    fitted = " → soil fitted" if comparison.soil else ""

    return page(
        f"gritd compare: {comparison.testbed}",
        _title(comparison),
        section(
            "Errors",
            table(head, rows, numbers=1),
            tag("p", f"Root mean square: as configured{fitted}.", class_="note"),
        ),
        section("Simulation against recording", tag("p", NOTE), _pictures(comparison)),
        _soil(comparison),
        _caveats(comparison),
        section("To redo it", redo.content(comparison.redo), class_="appendix"),
        redo.appendix(comparison.redo),
    )


def _title(comparison: Comparison) -> Markup:
    effects = (
        f"with {listed([name_of(b) for b in comparison.baseline])}"
        if comparison.baseline
        else "no effects"
    )
    kicker = (
        f"gritd compare · {comparison.testbed} · {counted(len(comparison.runs), 'run')} · {effects}"
    )

    summary = f"As configured, the simulation is off by {_off(comparison, 'before')}."
    if comparison.soil:
        summary += f" With the soil fitted, by {_off(comparison, 'after')}."

    lead = tag("p", held(summary), class_="summary")

    return tag(
        "header",
        tag("p", kicker, class_="kicker"),
        tag("h1", "Simulation and recording"),
        lead,
        class_="verdict",
    )


def _off(comparison: Comparison, which: str) -> str:
    """The error of every channel over all runs."""
    errors = []
    for channel in comparison.channels:
        unit, factor = shown(_unit(comparison.traces, channel))
        error = number(comparison.rms(channel, None, which) * factor, 2)
        errors.append(f"{error} {unit} in {name_of(channel)}")
    return listed(errors)


def _pictures(comparison: Comparison) -> Iterator[Markup]:
    key = figures.legend(
        {k: v for k, v in KEY.items() if comparison.soil or k != "after"}
        | {"unused": "not compared"}
    )

    if len(comparison.runs) == 1:
        yield figures.figure(
            f"All channels of {comparison.runs[0]}.",
            figures.channels(comparison.traces),
            legend=key,
        )
        return

    for channel in comparison.channels:
        of = [trace for trace in comparison.traces if trace.channel == channel]
        caption = f"{name_of(channel).capitalize()} of {counted(len(of), 'run')}."
        yield figures.figure(caption, figures.traces(of, len(of)), legend=key)


def _soil(comparison: Comparison) -> Markup | None:
    if comparison.soil is None:
        return None
    key = figures.legend({"prior": "known before", "after": "fitted"})
    caption = (
        "Soil, fitted within what was known before; ± 1σ thick and ± 2σ thin, "
        "as if nothing were left out."
    )
    return section(
        "The soil", figures.figure(caption, figures.soil(comparison.soil), legend=key, small=True)
    )


def _caveats(comparison: Comparison) -> Markup | None:
    return (
        section("Caveats", tag("ul", (tag("li", sentence(c)) for c in comparison.notes)))
        if comparison.notes
        else None
    )


def printed(comparison: Comparison) -> str:
    """The table of errors, the fitted soil and the caveats, for a terminal."""
    head, rows = comparison.errors()
    widths = [max(len(cell) for cell in column) for column in zip(head, *rows, strict=True)]

    lines = [
        "  ".join(
            c.ljust(w) if i == 0 else c.rjust(w)
            for i, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in (head, *rows)
    ]

    if comparison.soil:
        lines += ["", "root mean square residual as configured → with the soil fitted", ""]
        lines += [
            f"{name_of(k):20}{quantity(comparison.soil.prior[k])}  →  {quantity(q)}"
            for k, q in comparison.soil.after.items()
        ]

    lines += [f"note: {caveat}" for caveat in comparison.notes]
    return "\n".join(map(visible, lines))
