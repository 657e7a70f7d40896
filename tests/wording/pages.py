"""The words of the report's pages, without those of its curves."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from gritd.tools.report import diagnosis
from tests.tools.report import cases
from tests.wording.rig import output


@output
def report(folder: Path) -> Iterator[str]:
    for name in ("explained", "insufficient"):
        page = diagnosis.render(cases.ALL[name]()).removeprefix("<!DOCTYPE html>")
        body = ElementTree.fromstring(page).find("body")
        assert body is not None
        yield f"--- {name} ---"
        for paragraph in _paragraphs(body):
            yield from textwrap.wrap(paragraph, 110, break_long_words=False)
        yield ""


def _paragraphs(element: ElementTree.Element) -> Iterator[str]:
    """The text of each element that holds no other with text of its own."""
    if element.tag in ("svg", "style", "script"):
        return
    if element.tag in ("p", "li", "tr", "summary", "figcaption", "h1", "h2", "h3", "pre", "dl"):
        yield " | ".join(filter(None, (" ".join(text.split()) for text in element.itertext())))
        return
    for child in element:
        yield from _paragraphs(child)
