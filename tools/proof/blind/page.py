"""The score as one self-contained HTML page: tables, reliability, and the confusion matrix. No
script, no network.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from gritd.tools.proof.blind import tables
from gritd.tools.proof.blind.plant.concealed import UNLISTED as CONCEALED
from gritd.tools.proof.blind.verdicts import FAILED, INSUFFICIENT, NOTHING, UNLISTED, CaseRow

STYLE = """
:root { --ink: #1c1c1a; --faint: #6b6a64; --rule: #d8d6cf; --paper: #fdfcf9; 
  --hit: 27, 112, 80; --miss: 178, 66, 34; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e9e7e0; --faint: #a09d93; --rule: #3a3934; --paper: #1b1b19;
    --hit: 90, 190, 150; --miss: 226, 120, 84; }
}
* { box-sizing: border-box; }
body { margin: 2rem auto; max-width: 72rem; padding: 0 1rem;
       background: var(--paper); color: var(--ink);
       font: 1rem/1.5 Georgia, "Times New Roman", serif; }
h1 { font-size: 1.7rem; line-height: 1.2; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
p, li { max-width: 44rem; } code { font-size: 0.88em; overflow-wrap: anywhere; }
td.inset { padding-left: 1.8rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font: 0.85rem/1.4 system-ui, sans-serif;
        font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--rule); padding: 0.25rem 0.6rem;
         text-align: left; white-space: nowrap; }
thead th { color: var(--faint); font-weight: 600; }
.matrix td { text-align: center; padding: 0.1rem 0.3rem; min-width: 1.7rem;
             border: 1px solid var(--rule); }
.matrix thead th { height: 11.5rem; vertical-align: bottom; padding: 0 0.2rem; border: 0; }
.matrix thead th span { writing-mode: vertical-rl; transform: rotate(180deg); }
.matrix tbody th { font-weight: 400; }
.faint { color: var(--faint); }
@media print { body { margin: 0; max-width: none; font-size: 10pt; } .wide { overflow: visible; } }
"""
FIGURES = "Figures"  # the table without a head
OTHERS = (NOTHING, UNLISTED, INSUFFICIENT, FAILED, "(one of them)", "(another)")


def page(score: Mapping[str, Any], rows: Sequence[CaseRow], seal: str) -> str:
    """The whole page."""
    drawn = (
        f"<p>{score['cases']} cases, drawn and simulated by an independent plant. The answers were "
        "sealed before the first diagnosis; SHA-256 of the batch:<br>"
        f"<code>{escape(seal)}</code></p>"
    )
    parts = [
        "<h1>Blind trials of <code>gritd diagnose</code></h1>",
        drawn,
        *(_section(heading, table) for heading, table in tables.all_tables(score).items()),
        "<h2>Confusion matrix</h2><p>Rows: what was concealed. Columns: what was named first. A "
        "filled cell on its own name is a hit; shading is the share of the row.</p>",
        _matrix(score["confusion"]),
        "<h2>By effect</h2><p>Single effects at all strengths, whether detectable or not.</p>",
        _effects(score["effects"]),
        "<h2>What went wrong, case by case</h2>",
        _misses(rows),
    ]

    return _document("".join(parts))


def _section(heading: str, table: tables.Table) -> str:
    return f"<h2>{escape(heading)}</h2>{_table(table, head=heading != FIGURES)}"


def _document(body: str) -> str:
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    )
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}<title>gritd prove</title>'
        f"<style>{STYLE}</style></head>"
        f"<body>{body}</body></html>\n"
    )


def _table(table: tables.Table, head: bool = False) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in table[0]) if head else ""
    body = "".join(_row(row) for row in (table[1:] if head else table))
    return (
        f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
    )


def _row(row: Sequence[str]) -> str:
    """One row; a label that is set in is set in here as well."""
    inset = ' class="inset"' if row[0].startswith(" ") else ""
    first = f"<td{inset}>{escape(row[0].strip())}</td>"
    return "<tr>" + first + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:]) + "</tr>"


def _matrix(confusion: Mapping[str, Mapping[str, int]]) -> str:
    heard = {name for row in confusion.values() for name in row}
    names = sorted(heard - set(OTHERS)) + [name for name in OTHERS if name in heard]
    head = "".join(f'<th scope="col"><span>{escape(name)}</span></th>' for name in names)
    body = "".join(_matrix_row(truth, row, names) for truth, row in confusion.items())
    return (
        f'<div class="wide"><table class="matrix"><thead><tr><td></td>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _matrix_row(truth: str, row: Mapping[str, int], names: Iterable[str]) -> str:
    total = sum(row.values())
    cells = "".join(_cell(row.get(name, 0), total, _hit(truth, name)) for name in names)
    return f'<tr><th scope="row">{escape(truth)}</th>{cells}</tr>'


def _hit(truth: str, name: str) -> bool:
    """`truth` as in `score.confusion`: a stratum and a colon may stand before it."""
    _, _, concealed = truth.rpartition(": ")
    right = {"(none)": NOTHING, "(two effects)": "(one of them)"}
    right |= dict.fromkeys(CONCEALED, UNLISTED)
    return name == right.get(concealed, concealed)


def _cell(count: int, total: int, hit: bool) -> str:
    if not count:
        return "<td></td>"
    colour = "--hit" if hit else "--miss"
    shade = f"rgba(var({colour}), {0.15 + 0.6 * count / total:.2f})"
    return f'<td style="background: {shade}">{count}</td>'


def _effects(effects: Mapping[str, Any]) -> str:
    head = (
        "effect",
        "alarm",
        "first name",
        "fixed groups",
        "stated group",
        "campaign can tell",
        "three, fixed groups",
    )

    rows = [
        (
            name,
            tables.share_text(of["detected"]),
            *(tables.share_text(of["first"][by]) for by in ("name", "table", "engine", "plant")),
            tables.share_text(of["three"]["table"]),
        )
        for name, of in effects.items()
    ]

    return _table([head, *rows], head=True)


def _misses(rows: Sequence[CaseRow]) -> str:
    wrong = [row for row in rows if tables.missed(row)]
    if not wrong:
        return "<p>Nothing.</p>"
    items = "".join(
        f'<tr><td class="faint">{row.number}</td><td>{row.stratum}</td>'
        f"<td>{escape(tables.explained(row))}</td></tr>"
        for row in wrong
    )
    return f'<div class="wide"><table><tbody>{items}</tbody></table></div>'
