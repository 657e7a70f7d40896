"""Writes the key reference of docs/configuration.md from the format's tables: `python -m
gritd.tools.dev.config_reference`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from gritd.estimator.config.kinds import Kind
from gritd.estimator.config.schema import ABSENT, NEEDED, Key, Named, Section, Variant
from gritd.estimator.config.table import table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "configuration.md"
BEGIN = "<!-- from here on written by `python -m gritd.tools.dev.config_reference` -->\n"


def main() -> None:
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(text[: text.index(BEGIN)] + BEGIN + reference(), encoding="utf-8")


def reference() -> str:
    """Every key, in Markdown."""
    return "".join(_section("", table()))


def _section(path: str, section: Section) -> Iterator[str]:
    """A table of the section's own keys, then the sections inside."""
    rows = "".join(_row(name, key) for name, key in section.keys.items())
    yield (
        f"\n### {path or 'Top level'}\n\n| key | expected | default | meaning "
        f"|\n|---|---|---|---|\n{rows}"
    )
    for name, key in section.keys.items():
        yield from _inside(f"{path}.{name}" if path else name, key.kind)


def _inside(path: str, kind: Kind) -> Iterator[str]:
    if isinstance(kind, Section):
        yield from _section(path, kind)
    elif isinstance(kind, Named):
        yield from _inside(f"{path}.NAME", kind.kind)
    elif isinstance(kind, Variant):
        for case, section in kind.cases.items():
            yield from _section(f"{path} ({kind.selector}: {case})", section)


def _row(name: str, key: Key) -> str:
    default = {NEEDED: "required", ABSENT: "none"}.get(key.default, f"`{key.default}`")
    return f"| `{name}` | {key.kind.expected} | {default} | {key.doc} |\n"


if __name__ == "__main__":
    main()
