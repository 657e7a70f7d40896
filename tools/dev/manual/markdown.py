"""The site's reference of the commands: a page each, with its options and what it printed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from gritd.tools.dev.manual.examples import EXAMPLES
from gritd.tools.dev.manual.outputs import Printed
from gritd.tools.dev.manual.page import EXIT_CODES, ManualPage

MARKUP = re.compile(r"([*_<>\[\]$\\])")
KEPT = 30  # lines of a long output, at either end


def reference(of: Mapping[str, ManualPage], printed: Mapping[str, Printed]) -> dict[str, str]:
    """File name → MyST."""
    return {
        f"{name}.md": "\n".join(_page(name, page, printed.get(name, [])))
        for name, page in of.items()
    }


def _page(name: str, page: ManualPage, printed: Printed) -> Iterator[str]:
    yield f"# {page.name}\n"
    yield f"{_text(page.description)}\n"
    yield _block(page.usage)
    yield from _entries(page)

    for below in page.below:
        yield f"## {below.name}\n"
        yield f"{_text(below.summary or below.description)}\n"
        yield _block(below.usage)
        yield from _entries(below)

    yield "## Example\n"
    yield from _example(name, printed)

    yield "## Exit codes\n"
    for code, text in EXIT_CODES.items():
        yield f"`{code}`\n: {text}\n"


def _example(name: str, printed: Printed) -> Iterator[str]:
    example = EXAMPLES[name]
    if example.shown:
        yield _block("\n".join(example.lines))
        yield f"It runs for minutes. [What it prints](../../{example.shown}.md).\n"
    for line, text in zip(example.lines, printed, strict=False):
        yield _block("\n".join([f"$ {line}", *_cut(text.rstrip().splitlines())]))


def _cut(lines: list[str]) -> list[str]:
    """Beginning and end of a long output."""
    left_out = len(lines) - 2 * KEPT
    return lines if left_out <= 0 else [*lines[:KEPT], f"… {left_out} lines …", *lines[-KEPT:]]


def _entries(page: ManualPage) -> Iterator[str]:
    for entry in page.entries:
        yield f"`{entry.written}`\n: {_text(entry.text) or '–'}\n"


def _block(text: str) -> str:
    return f"```text\n{text}\n```\n"


def _text(text: str) -> str:
    """A paragraph: nothing of it is markup but `code`."""
    parts = " ".join(text.split()).split("`")
    return "`".join(part if at % 2 else MARKUP.sub(r"\\\1", part) for at, part in enumerate(parts))
