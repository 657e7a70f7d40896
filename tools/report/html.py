"""HTML as nested calls: whatever is not Markup is escaped, so no text from outside can become
markup.

The output is well-formed XML as well as HTML.
"""

from __future__ import annotations

import base64
import hashlib
import html
import re
from collections.abc import Iterable
from importlib import resources
from typing import TypeAlias

SHORT = 16  # letters that are never broken in a table
VOID = frozenset(("meta", "br", "path", "line", "rect", "circle"))
# Controls, lone surrogates (from file names that are not UTF-8) and marks that turn the direction
# of writing.
UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
POLICY = (  # of scripts the one in the page alone, by its hash
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{}'"
)


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


Child: TypeAlias = "str | Iterable[Child] | None"


def escape(text: str) -> Markup:
    """The text as it should be seen; what cannot be seen becomes U+FFFD."""
    return (
        text if isinstance(text, Markup) else Markup(html.escape(UNPRINTABLE.sub("\ufffd", text)))
    )


def join(*children: Child) -> Markup:
    """Children in a row, nested iterables unfolded; None is nothing."""
    parts = []
    for child in children:
        if isinstance(child, str):
            parts.append(escape(child))
        elif child is not None:
            parts.extend(join(item) for item in child)
    return Markup("".join(parts))


def tag(name: str, /, *children: Child, **attributes: str | float | None) -> Markup:
    """`<name …>children</name>`. In attribute names `class_` is class and `_` is `-`; None leaves
    one out.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_attribute(value)}"'
        for key, value in attributes.items()
        if value is not None
    )

    return Markup(
        f"<{name}{written}/>" if name in VOID else f"<{name}{written}>{join(*children)}</{name}>"
    )


def _attribute(value: str | float) -> str:
    return escape(value) if isinstance(value, str) else f"{value:.2f}".rstrip("0").rstrip(".")


def table(
    head: Iterable[str], rows: Iterable[Iterable[Child]], *, numbers: int = 0, caption: str = ""
) -> Markup:
    """A table whose first column names the row and whose columns from `numbers` (0: none) on are
    numbers.

    On a narrow screen each row becomes a block, every cell under the name of its column.
    """
    names = list(head)

    def kind(at: int, content: Child = "") -> str | None:
        if 0 < numbers <= at:
            return "number"
        return (
            "short"
            if isinstance(content, str)
            and not isinstance(content, Markup)
            and len(content) <= SHORT
            else None
        )

    def cell(at: int, content: Child) -> Markup:
        if at == 0:
            return tag("th", content, scope="row", class_=kind(at, content))
        return tag("td", tag("span", content), class_=kind(at, content), data_name=names[at])

    top = (tag("th", name, scope="col", class_=kind(at)) for at, name in enumerate(names))
    body = (tag("tr", (cell(at, content) for at, content in enumerate(row))) for row in rows)
    title = tag("caption", caption) if caption else None
    narrow = "narrow" if numbers and len(names) == 2 else None
    return tag("table", title, tag("thead", tag("tr", top)), tag("tbody", body), class_=narrow)


def section(title: str, *content: Child, class_: str | None = None) -> Markup:
    return tag("section", tag("h2", title), *content, class_=class_)


def page(title: str, *body: Child) -> str:
    """The whole document, style and script included."""
    style, script = _packaged("style.css"), _packaged("zoom.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()

    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=POLICY.format(digest)),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", title),
        tag("style", Markup(style)),
    )

    whole = tag("body", tag("main", *body), tag("script", Markup(script)))
    return "<!DOCTYPE html>\n" + tag("html", head, whole, lang="en") + "\n"


def _packaged(name: str) -> str:
    return resources.files("gritd.tools.report").joinpath(name).read_text(encoding="utf-8")
