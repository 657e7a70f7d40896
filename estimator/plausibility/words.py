"""A table of runs, and a line for each thing in them that cannot be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.plausibility import noise
from gritd.estimator.plausibility.checks import contradictions
from gritd.estimator.plausibility.contradiction import Contradiction
from gritd.estimator.plausibility.driven import DrivenRun
from gritd.estimator.plausibility.mistakes import OF_A_RECORDING, Sources
from gritd.estimator.terramechanics.soil import Array

HEADING = (
    "run",
    "Hz",
    "s",
    "gaps",
    "slip",
    "± in a window",
    "z/r",
    "W [N]",
    "stated",
    "T/(rW)",
    "DP/W",
)
DASH = "–"


def sentences(given: Sequence[tuple[DrivenRun, Settings]], sources: Sources) -> Iterator[str]:
    """The table, then what cannot be, then which noise exceeds the stated σ."""
    yield from table(given)
    yield from warnings(given, sources)
    yield from louder(given)


def warnings(
    given: Sequence[tuple[DrivenRun, Settings]], sources: Sources = OF_A_RECORDING
) -> Iterator[str]:
    """A line for each thing that physics or the configuration forbids, with the likely remedy."""
    each = [(run.name, contradictions(run, settings, sources)) for run, settings in given]
    return (f"cannot be: {line}" for line in _once(each))


def louder(given: Sequence[tuple[DrivenRun, Settings]]) -> Iterator[str]:
    """A line for each sensor that scatters by more than its stated noise."""
    each = [(run.name, tuple(noise.louder(run, settings))) for run, settings in given]
    return (f"noise exceeds the stated σ: {line}" for line in _once(each))


def _once(each: Sequence[tuple[str, Sequence[Contradiction]]]) -> Iterator[str]:
    """Of several runs that differ in figures alone, the first is quoted."""
    found: dict[str, list[tuple[str, Contradiction]]] = {}
    for name, those in each:
        for one in those:
            found.setdefault(one.kind, []).append((name, one))

    for same in found.values():
        name, first = same[0]
        if first.alone or len(same) == len(each):
            yield f"{_named(name, len(same), len(each))}{first.text}"


def _named(name: str, count: int, of: int) -> str:
    """The run that is quoted, and how many are like it."""
    if of == 1:
        return f"{name}: " if name else ""
    more = f" and {count - 1} more of {of} runs" if count > 1 else f" of {of} runs"
    return f"{name}{more}: "


# --- the table ---


def table(given: Sequence[tuple[DrivenRun, Settings]]) -> Iterator[str]:
    """A row a run: usual ranges, 5 to 95 % of the windows in which the wheel drives."""
    yield "while the wheel drives, 5 to 95 % of the windows:"
    rows = [HEADING, *(_row(run, settings) for run, settings in given)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]

    for row in rows:
        cells = zip(row[1:], widths[1:], strict=True)
        yield "  ".join([f"{row[0]:<{widths[0]}}", *(f"{cell:>{width}}" for cell, width in cells)])


@np.errstate(all="ignore")  # numbers that are none stay none
def _row(run: DrivenRun, settings: Settings) -> tuple[str, ...]:
    clock, course = run.clock, run.course
    driving, radius = course.driving, settings.wheel.radius
    load = course.load[driving] if np.isfinite(course.load).any() else settings.load.nominal.value

    torque, pull = course.torque[driving] / (radius * load), course.pull[driving] / load
    return (
        run.name,
        f"{1.0 / clock.interval:.4g}" if clock.interval else DASH,
        f"{clock.duration:.1f}",
        str(clock.gaps),
        _range(course.slip),
        f"{run.slip_sigma:.3f} {round(run.window, 2):g} s" if isfinite(run.slip_sigma) else DASH,
        _range(course.sinkage[driving] / radius),
        _range(course.load[driving], 1),
        DASH if run.stated_load is None else f"{run.stated_load:g}",
        _range(torque),
        _range(pull),
    )


def _range(values: Array, digits: int = 2) -> str:
    known = values[np.isfinite(values)]
    if not known.size:
        return DASH
    low, high = (f"{round(x, digits) + 0.0:.{digits}f}" for x in np.percentile(known, (5.0, 95.0)))
    return low if low == high else f"{low} … {high}"
