"""The section of docs/proof.md that the proofs write."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gritd.tools.proof.real.proof import Asked, Finding, Proof, Table

BEGIN = "<!-- {name}: from here on written by `make proof` -->\n"
END = "<!-- {name}: to here -->\n"


def page(old: str, name: str, section: str) -> str:
    """The page with the section of one proof replaced; appended where it has none."""
    begin, end = BEGIN.format(name=name), END.format(name=name)
    head, found, rest = old.partition(begin)
    tail = rest.partition(end)[2] if found else ""
    return head + ("" if found else "\n") + begin + "\n" + section + "\n" + end + tail


def section(proof: Proof, finding: Finding, commands: Sequence[str], seconds: float) -> str:
    """What the page says of one proof."""
    return "\n".join(_lines(proof, finding, commands, seconds))


def _lines(
    proof: Proof, finding: Finding, commands: Sequence[str], seconds: float
) -> Iterator[str]:
    yield f"### {proof.title}"
    yield ""

    yield f"**Concealed.** {flowing(proof.concealed)}"
    yield ""

    yield f"**Seen.** {flowing(proof.saw)}"
    yield ""

    yield "**Judged.** " + _verdict(finding.asked)
    yield ""

    yield from _table(Table(("", "asked", "wanted", "found"), [_row(a) for a in finding.asked]))
    yield ""
    yield from _table(finding.table)
    yield ""

    yield f"![{proof.title}](proof-{proof.name}.png)"
    yield ""

    yield from _missed([a for a in finding.asked if not a.met])

    yield f"**Said**, unedited, in {seconds:.0f} s for all commands of this proof:"
    yield ""

    for said in finding.said:
        yield "```"
        yield f"$ {said.command}"
        yield said.text
        yield "```"
        yield ""

    others = [c for c in commands if c not in {s.command for s in finding.said}]
    yield "The other commands:"
    yield ""
    yield from ("```sh", *others, "```")
    yield ""


def _missed(asked: Sequence[Asked]) -> Iterator[str]:
    """Each reason once, after the questions it stands for."""
    reasons: dict[str, list[str]] = {}
    for a in asked:
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


def _verdict(asked: Sequence[Asked]) -> str:
    return f"{sum(a.met for a in asked)} of {len(asked)} as wanted."


def _row(asked: Asked) -> tuple[str, str, str, str]:
    return "yes" if asked.met else "**no**", asked.question, asked.wanted, asked.found


def _table(table: Table) -> Iterator[str]:
    yield "| " + " | ".join(table.heads) + " |"
    yield "|" + "---|" * len(table.heads)
    for row in table.rows:
        yield "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |"
