"""The table in Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from gritd.tools.dev.sensitivity.forks import SensitivityCase
from gritd.tools.dev.sensitivity.numbers import FIXED, Field, every_field
from gritd.tools.dev.sensitivity.runs import DiagnosedRuns

HEAD = """\
# What each tuned number decides

Every tuned number of the diagnosis is halved and doubled, one at a time
(`python -m gritd.tools.dev.sensitivity`). Shares and probabilities are halved and doubled in their
odds, quantiles in the odds of their tail. The columns "verdicts" and "names" count the diagnoses in
which the verdict, or the names that it accepts, are another, and say which campaigns they are of.
Δp is the largest change of an effect's probability. Δtan φ is the largest change of the soil's
tan φ, in its standard deviation. A number that a campaign does not read before its verdict is not
run on it: it can change only what is reported of the verdict. The reason of each number, and what
it was learnt from, stand in `tools/diagnose/tuning/`.

A diagnosis does not depend on a number before it reads it. So each diagnosis with another number is
forked from the one with the numbers as they are, where the number is first read. It ends as soon as
a room hands on what it does anyway, bit for bit, if the number is not read after that.
"""
DECISIVE = 3  # diagnoses with another verdict or other names, from which a number decides much
BY_HAND, TABLE = "## What it shows", "## The table"  # headings


def by_hand(text: str) -> str:
    """The part of a page that a person wrote: it stays when the page is made anew."""
    _, heading, rest = text.partition(BY_HAND)
    return heading + rest.partition(TABLE)[0] if heading else ""


def page(
    runs: DiagnosedRuns,
    only: Collection[str] = (),
    campaigns: Collection[str] = (),
    of: str = "",
    shown: str = "",
) -> str:
    """campaigns: all of the folder; of: what the table was made of; shown: the part by hand."""
    asked = [f for f in every_field() if any(c.field == f for c in runs.moved)]
    table = [
        "| number | value | runs | verdicts | names | Δp | Δtan φ |",
        "|---|---|--:|---|---|--:|--:|",
        *(_row(f, runs) for f in asked),
    ]

    parts = [
        HEAD,
        _extent(runs, only, campaigns, of),
        shown,
        TABLE,
        _summary(runs),
        "\n".join(table),
    ]
    return "\n\n".join([*(part.strip() for part in parts if part), _rest(runs)]).strip() + "\n"


def _extent(runs: DiagnosedRuns, only: Collection[str], campaigns: Collection[str], of: str) -> str:
    """Which campaigns were run, how far, and how long it took."""
    cases = runs.cases(only)
    done, fresh = len(runs.moved), sum(runs.seconds[c.campaign] for c in runs.moved) / 3600.0
    kind = "complete" if done == len(cases) else f"partial: {done} of {len(cases)} diagnoses"

    lines = [
        f"This table is {kind}. {of}".strip(),
        f"The diagnoses took {sum(runs.spent.values()) / 60.0:.0f} min of a core; each from its"
        f" beginning would have taken {fresh:.1f} h.",
        "",
    ]

    for name in runs.campaigns():
        own = [c for c in cases if c.campaign == name]
        outcome = runs.before[name]
        lines.append(
            f"- `{name}` ({outcome.verdict}: {', '.join(outcome.accepted) or 'no name'}):"
            f" {sum(c in runs.moved for c in own)} of {len(own)} diagnoses,"
            f" {len(runs.read[name])} numbers read, {runs.seconds[name]:.0f} s for one"
        )

    if rest := [name for name in campaigns if name not in runs.read]:
        lines += ["", f"Not begun: {', '.join(f'`{name}`' for name in rest)}."]
    return "\n".join(lines)


def _summary(runs: DiagnosedRuns) -> str:
    """Which numbers decide most, and which nothing."""
    flips = Counter(c.field for c, m in runs.moved.items() if m.verdict or m.names)

    most = [f"`{f}` ({n})" for f, n in flips.most_common() if n >= DECISIVE]
    run = {c.field for c in runs.moved}
    touched = {c.field for c, m in runs.moved.items() if not m.nothing}
    still = [f for f in every_field() if f in run and f not in touched]

    changes = sum(m.verdict or m.names for m in runs.moved.values())
    lines = [
        f"Of {len(run)} numbers, {len(flips)} change a verdict or its names somewhere:"
        f" {changes} of {len(runs.moved)} diagnoses."
    ]

    if most:
        lines += ["", f"In {DECISIVE} diagnoses or more: {', '.join(most)}."]
    if still:
        counts = Counter(c.field for c in runs.moved)
        listed = ", ".join(f"`{f}` ({counts[f]})" for f in still)
        lines += [
            "",
            f"{len(still)} numbers moved nothing, to the last digit, in any diagnosis (in brackets,"
            f" how many there were): {listed}.",
        ]
    return "\n".join(lines)


def _row(f: Field, runs: DiagnosedRuns) -> str:
    moved = {case: m for case, m in runs.moved.items() if case.field == f}

    cells = [
        f"`{f}`",
        _number(f.value),
        str(len(moved)),
        _which(c for c, m in moved.items() if m.verdict),
        _which(c for c, m in moved.items() if m.names),
        f"{max(m.probability for m in moved.values()):.2f}",
        f"{max(m.sigmas for m in moved.values()):.2f}",
    ]
    return f"| {' | '.join(cells)} |"


def _which(cases: Iterable[SensitivityCase]) -> str:
    """How many, and which: `2: nothing ½, ding ×2`."""
    ordered = sorted(cases, key=lambda c: (c.campaign, c.factor))
    named = [f"{c.campaign} {'½' if c.factor < 1.0 else '×2'}" for c in ordered]
    return f"{len(named)}: {', '.join(named)}" if named else "0"


def _number(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_number(each)}" for name, each in value.items())
    if isinstance(value, tuple):
        return ", ".join(_number(each) for each in value)
    return f"{value:g}"


def _rest(runs: DiagnosedRuns) -> str:
    """Numbers that were not run, and why."""
    read = frozenset().union(*runs.read.values())
    rest = [f for f in every_field() if not any(c.field == f for c in runs.moved)]
    parts: dict[str, list[str]] = {}
    for f in rest:
        parts.setdefault(_why(f, read), []).append(f"`{f}`")
    return "\n\n".join(f"{why}: {', '.join(some)}." for why, some in parts.items())


def _why(f: Field, read: Collection[Field]) -> str:
    if f.unit in FIXED:
        return "Not a size, not run"
    if f in read:
        return "Not run yet" if f.factors() else "Neither half nor double is another value, not run"
    return "Read by none of these before the verdict, not run"
