"""The sections of docs/real-recordings.md that the proofs write."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gritd.tools.proof.real.proof import Check, FigureTable, Finding, Proof

BEGIN = "<!-- {name}: from here on written by `make proof` -->\n"
END = "<!-- {name}: to here -->\n"


def page(old: str, name: str, section: str) -> str:
    """The page with the section of one proof replaced; appended where it has none."""
    begin, end = BEGIN.format(name=name), END.format(name=name)
    head, marker, rest = old.partition(begin)
    tail = rest.partition(end)[2] if marker else ""
    return head + ("" if marker else "\n") + begin + "\n" + section + "\n" + end + tail


def section(proof: Proof, finding: Finding, commands: Sequence[str], seconds: float) -> str:
    """What the page says of one proof."""
    return "\n".join(_lines(proof, finding, commands, seconds))


def _lines(
    proof: Proof, finding: Finding, commands: Sequence[str], seconds: float
) -> Iterator[str]:
    yield f"## {proof.title}"
    yield ""

    yield f"**Concealed.** {flowing(proof.concealed)}"
    yield ""

    yield f"**Seen.** {flowing(proof.saw)}"
    yield ""

    yield "**Judged.** " + _verdict(finding.checks)
    yield ""

    yield from _table(
        FigureTable(("", "asked", "wanted", "found"), [_row(check) for check in finding.checks])
    )
    yield ""
    yield from _table(finding.table)
    yield ""

    yield f"![{proof.title}](proof-{proof.name}.png)"
    yield ""

    yield from _missed([check for check in finding.checks if not check.met])

    yield f"**Commands**, {seconds:.0f} s in all:"
    yield ""
    yield from ("```sh", *commands, "```")
    yield ""


def _missed(checks: Sequence[Check]) -> Iterator[str]:
    """Each reason once, after the questions it stands for."""
    reasons: dict[str, list[str]] = {}
    for a in checks:
        reasons.setdefault(flowing(a.reason) or "The reason was not found.", []).append(
            f"*{a.question}*"
        )

    if reasons:
        yield "**Missed.** " + " ".join(
            f"{' '.join(questions)} {why}" for why, questions in reasons.items()
        )
        yield ""


def flowing(prose: str) -> str:
    """Prose without line breaks."""
    return " ".join(prose.split())


def _verdict(checks: Sequence[Check]) -> str:
    return f"{sum(check.met for check in checks)} of {len(checks)} as wanted."


def _row(check: Check) -> tuple[str, str, str, str]:
    return "yes" if check.met else "**no**", check.question, check.wanted, check.answer


def _table(table: FigureTable) -> Iterator[str]:
    yield "| " + " | ".join(table.heads) + " |"
    yield "|" + "---|" * len(table.heads)
    for row in table.rows:
        yield "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |"
