"""A configuration file changed key by key: its comments, its order and its layout stay.

ruamel.yaml keeps what PyYAML forgets. The lines `---` and `...` and all outside them are not given
to it. A value that is broken over several lines inside braces is put on one.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import CommentMark
from ruamel.yaml.tokens import CommentToken

from gritd.estimator.config import units
from gritd.estimator.config.yamltree import compose

BEGIN = re.compile(r"^---[ \t]*(?:#.*)?$", re.MULTILINE)
INDENTED = re.compile(r"^( +)[^\s#-]", re.MULTILINE)
DASH = re.compile(r"^[^\s#][^\n]*:[ \t]*\n( *)- ", re.MULTILINE)
END = re.compile(r"^\.\.\.[ \t]*(?:#.*)?$", re.MULTILINE)
DIGITS = 3  # of a standard deviation; a value has the places of the last of them


class EditedYaml:
    """The text of a YAML mapping, under change."""

    def __init__(self, text: str, file: str) -> None:
        """`file` stands in messages. Raises ConfigError where the text is no valid document."""
        compose(text, file)
        self._newline = "\r\n" if "\r\n" in text else "\n"
        self._before, body, self._after = _parts(text.replace("\r\n", "\n"))

        self._yaml = _round_trip(body)
        self._document: Any = self._yaml.load(body)

    def has(self, *path: str) -> bool:
        """Whether a key is there."""
        node = self._document
        for key in path:
            if not isinstance(node, Mapping) or key not in node:
                return False
            node = node[key]
        return True

    def keys(self, *path: str) -> list[str]:
        """The keys of a mapping; none where it is not there."""
        node = self._document
        for key in path:
            node = node.get(key, {}) if isinstance(node, Mapping) else {}
        return list(map(str, node)) if isinstance(node, Mapping) else []

    def written(self, *path: str) -> str:
        """The value of a scalar key as it is written, or that of its `value`; empty where it is
        not there.
        """
        node = self._document
        for key in path:
            node = node.get(key, {}) if isinstance(node, Mapping) else {}
        if isinstance(node, Mapping):
            node = node.get("value", "")
        return str(node)

    def set(self, path: Sequence[str], fragment: str) -> None:
        """Put YAML text at a key; the mappings above it are made where they are missing. A value
        and a sigma take the places of those that stand there.
        """
        node = self._document
        for key in path[:-1]:
            if not isinstance(node.get(key), Mapping):
                _put(node, key, CommentedMap())
            node = node[key]
        _put(node, path[-1], self._yaml.load(fragment))

    def remove(self, *path: str) -> None:
        """Take a key away, if it is there; the empty lines below it stay."""
        if not self.has(*path):
            return
        node = self._document
        for key in path[:-1]:
            node = node[key]

        comment = _below(node, path[-1])
        keys = list(node)
        del node[path[-1]]
        if comment and len(keys) > 1 and keys[-1] == path[-1] and not _is_followed(node):
            _follow(node, keys[-2], comment)

    def text(self) -> str:
        """The whole text as it is now."""
        stream = io.StringIO()
        self._yaml.dump(self._document, stream)
        whole = self._before + stream.getvalue() + self._after
        return whole.replace("\n", self._newline)


def quantity(
    value: float,
    sigma: float,
    unit: str,
    like: str = "",
    bounds: tuple[float, float] = (-inf, inf),
) -> str:
    """YAML text of a quantity in SI, whose SI unit is `unit`, written in the unit that `like` has,
    if it has one. Without a sigma it is a plain value. bounds: no rounding leads out of these.
    """
    shown = _unit_of(like) or unit
    factor = float(units.unit(shown).factor / units.unit(unit).factor)
    value, sigma = value / factor, sigma / factor
    if not sigma > 0.0:
        return _number(float(f"{value:.9g}"), shown)

    places = _places(sigma)
    rounded = round(value, places)
    inside = bounds[0] <= rounded * factor <= bounds[1]
    written = _number(rounded if inside else float(f"{value:.9g}"), shown)
    return f"{{value: {written}, sigma: {_number(round(sigma, places), shown)}}}"


def plain_text(text: str) -> str:
    """YAML text of a word or a sentence, in quotes, so that 12 and `no` stay text."""
    return "'" + text.replace("'", "''") + "'"


def _unit_of(text: str) -> str:
    try:
        return units.split(text)[1]
    except units.UnitError:
        return ""


def _number(value: float, unit: str) -> str:
    """Without an exponent, which YAML would read as text."""
    return f"{np.format_float_positional(value + 0.0, trim='0')} {unit}".rstrip()


def _places(sigma: float) -> int:
    """Decimal places that show DIGITS digits of a standard deviation."""
    return DIGITS - 1 - int(f"{sigma:e}".partition("e")[2])


def _parts(text: str) -> tuple[str, str, str]:
    """What stands before the document, the document, and what stands behind it."""
    begin = BEGIN.search(text)
    start = begin.end() + 1 if begin else 0
    end = END.search(text, start)
    stop = end.start() if end else len(text)
    return text[:start], text[start:stop], text[stop:]


def _round_trip(body: str) -> YAML:
    """A round-trip YAML with the indentation of the text."""
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 1_000_000

    indented, dash = INDENTED.search(body), DASH.search(body)
    offset = len(dash[1]) if dash else 0
    yaml.indent(len(indented[1]) if indented else 2, offset + 2, offset)
    return yaml


def _put(node: Any, key: str, value: Any) -> None:
    """Set a key of a mapping. A new one goes before the last, where empty lines or comments follow
    that one: they belong to the end of the mapping.
    """
    old = node.get(key)

    if isinstance(old, Mapping) and isinstance(value, Mapping) and set(old) == set(value):
        for name, item in value.items():
            node[key][name] = item
    elif key not in node and _is_followed(node):
        node.insert(len(node) - 1, key, value)
    else:
        node[key] = value


def _is_followed(node: Any) -> bool:
    """Whether lines without a key stand below the last key of a mapping."""
    if not isinstance(node, CommentedMap) or not node:
        return False
    last = next(reversed(node))
    return bool(_below(node, last)) or _is_followed(node[last])


def _below(node: Any, key: str) -> str:
    """The lines without a key that stand below a scalar; empty where there are none."""
    comment = (node.ca.items.get(key) or [None] * 3)[2]
    return "" if comment is None else str(comment.value).partition("\n")[2]


def _follow(node: Any, key: str, below: str) -> None:
    """Put such lines below another scalar."""
    comment = (node.ca.items.get(key) or [None] * 4)[2]
    if comment is not None:
        comment.value = comment.value.rstrip("\n") + "\n" + below
    elif not isinstance(node[key], Mapping):
        token = CommentToken("\n" + below, CommentMark(0), None)
        node.ca.items[key] = [None, None, token, None]
