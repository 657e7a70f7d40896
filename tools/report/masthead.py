"""What a page for the lab book begins with: the rig, the date, who ran it, what was noted, and a
table of the runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from gritd.tools.cli.wording import NOTHING, listed
from gritd.tools.report.html import Markup, section, table, tag

DATE, OPERATOR, NOTES = "date", "operator", "notes"  # of a record
UNSTATED = "not stated"
DAY = len("2026-11-22")

Record = Mapping[str, str]  # of one run: a text a column


def masthead(rig: str, records: Sequence[Record]) -> Markup:
    """Rig, date, operator and notes of all runs."""
    return tag(
        "dl",
        (tag("div", tag("dt", term), tag("dd", words)) for term, words in _entries(rig, records)),
        class_="masthead",
    )


def _entries(rig: str, records: Sequence[Record]) -> Iterator[tuple[str, str]]:
    """Notes that differ from run to run stand in the table of runs."""
    if rig:
        yield "rig", rig
    if days := _days(records):
        yield "date", days
    yield "operator", listed(_distinct(records, OPERATOR)) or UNSTATED
    if notes := _distinct(records, NOTES):
        yield "notes", notes[0] if _same(records, NOTES) else "see the runs"


def _days(records: Sequence[Record]) -> str:
    """The first and the last day."""
    days = sorted({day[:DAY] for day in _distinct(records, DATE) if day != NOTHING})
    return " … ".join(dict.fromkeys((days[0], days[-1]))) + " (UTC)" if days else ""


def _distinct(records: Sequence[Record], key: str) -> list[str]:
    """Values of a key, each once, in the order of the runs."""
    return [words for words in dict.fromkeys(r.get(key, "") for r in records) if words]


def _same(records: Sequence[Record], key: str) -> bool:
    return len({record.get(key, "") for record in records}) < 2


def runs(records: Sequence[Record]) -> Markup | None:
    """The table of runs; who ran it and what was noted stand in it where runs differ in that."""
    if not records:
        return None
    head = [
        name for name in records[0] if name not in (OPERATOR, NOTES) or not _same(records, name)
    ]
    rows = [[record.get(name, "") or NOTHING for name in head] for record in records]
    return section("Runs", table(head, rows))
