"""The site has every page of docs/ once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

DOCS = Path(__file__).parents[2] / "docs"


def listed(entry: dict[str, Any]) -> Iterator[str]:
    """The pages of an entry of the table of contents, and of those below."""
    if "glob" in entry:
        yield from (str(path.relative_to(DOCS)) for path in DOCS.glob(f"{entry['glob']}.md"))
    else:
        yield f"{entry.get('file', entry.get('root'))}.md"
    for below in entry.get("entries", []):
        yield from listed(below)
    for tree in entry.get("subtrees", []):
        yield from (page for below in tree["entries"] for page in listed(below))


def test_every_page_is_in_the_table_of_contents_once() -> None:
    contents = yaml.safe_load((DOCS / "site" / "toc.yml").read_text(encoding="utf-8"))
    found = Counter(listed(contents))
    pages = Counter(str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md"))

    assert {page: count for page, count in found.items() if count > 1} == {}
    assert found == pages
