"""What it takes to do a computation again: command line, files with their checksums, configuration,
versions, seed.

Keys are shown as they are found: a text of several lines is folded, a list of mappings is a table,
    the rest are rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gritd.tools.report.html import Child, Markup, section, table, tag

NAMES = {"sha256": "SHA-256"}


def content(redo: Mapping[str, Any]) -> list[Markup]:
    """The command line, the files with their checksums, and what is short; long texts are the
    appendix.
    """
    command = redo.get("command", "")
    others = {key: _records(key, value) for key, value in redo.items() if key != "command"}
    short = {
        key: value for key, value in others.items() if not _tabular(value) and not _long(value)
    }
    rows = [(_name(key), tag("span", _words(value), class_="code")) for key, value in short.items()]

    parts = [tag("pre", _command(command), class_="command")] if command else []
    parts += [_files(key, value) for key, value in others.items() if _tabular(value)]
    return parts + ([table(("what", "as used"), rows)] if rows else [])


def appendix(redo: Mapping[str, Any]) -> Markup | None:
    """Long texts, folded: the configuration."""
    folded = [_folded(_name(key), value) for key, value in redo.items() if _long(value)]
    return section("Appendix", folded, class_="appendix") if folded else None


def _records(key: str, value: Any) -> Any:
    """Files with nothing but their checksum become a table too."""
    if (
        key == "files"
        and isinstance(value, Mapping)
        and all(isinstance(v, str) for v in value.values())
    ):
        return [{"file": name, "sha256": sha256} for name, sha256 in value.items()]
    return value


def _name(key: object) -> str:
    text = str(key)
    return NAMES.get(text, text.replace("_", " "))


def _command(command: Any) -> str:
    return command if isinstance(command, str) else " ".join(map(str, command))


def _tabular(value: Any) -> bool:
    """A list of mappings, or a mapping of mappings."""
    items = value.values() if isinstance(value, Mapping) else value
    if isinstance(items, str) or not hasattr(items, "__iter__"):
        return False
    every = list(items)
    return bool(every) and all(isinstance(item, Mapping) for item in every)


def _long(value: Any) -> bool:
    return isinstance(value, str) and "\n" in value.strip()


def _files(key: str, value: Any) -> Markup:
    named = isinstance(value, Mapping)
    records = [{key: name, **record} for name, record in value.items()] if named else list(value)
    columns = list(dict.fromkeys(column for record in records for column in record))
    rows = [
        [tag("span", _words(record.get(column, "")), class_="code") for column in columns]
        for record in records
    ]
    return table([_name(column) for column in columns], rows)


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{_name(k)} {_words(v)}" for k, v in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(_words(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _folded(name: str, value: str) -> Markup:
    body: Child = tag("pre", value)
    return tag("details", tag("summary", name), body)
