"""Kinds of values that are made of others: sections of a configuration, and what stands in them.

A `Section` is a table of keys; parsing, defaults, error lines and the key reference all come
from it. Reading returns the value and the node completed with the defaults, so that the
effective configuration is a by-product.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass
from typing import Any

from gritd.estimator.config import units
from gritd.estimator.config.kinds import WHOLE, Choice, Kind, NumberWithUnit
from gritd.estimator.config.nearest import KEYS_ALIKE, did_you_mean
from gritd.estimator.config.settings import Uncertain
from gritd.estimator.config.yamltree import (
    FilePosition,
    Mapping,
    Node,
    Scalar,
    YamlSequence,
    compose,
    describe,
    shown,
)

NEEDED = "\0needed"
ABSENT = "\0absent"  # may be left out, and then there is none
NAMES = r"[A-Za-z_][A-Za-z0-9_.-]{0,63}"  # of the user's choosing


class Impossible(Exception):
    """Values that cannot go together: which key (dotted, within the section), and what was
    expected of it.
    """

    def __init__(self, key: str, expected: str, found: str = "") -> None:
        super().__init__(key, expected, found)
        self.key, self.expected, self.found = key, expected, found


@dataclass(frozen=True)
class Key:
    """One key of a section: kind, what it means, and the default as it would be written in the
    file.
    """

    kind: Kind
    doc: str
    default: str = NEEDED


@dataclass(frozen=True)
class UncertainQuantity:
    """A quantity, or a mapping of value and sigma. The plain form has sigma 0."""

    quantity: NumberWithUnit

    @property
    def expected(self) -> str:
        return f"{self.quantity.expected}, or {{value, sigma}}"

    def read(self, node: Node) -> tuple[Uncertain, Node]:
        if not isinstance(node, Mapping):
            if isinstance(node, YamlSequence):
                raise node.place.error(describe(node), self.expected)
            value, _ = self.quantity.read(node)
            return Uncertain(value), node
        return self.mapping().read(node)

    def mapping(self) -> Section:
        """The form with both."""
        sigma = NumberWithUnit(self.quantity.unit, low=0.0, high=self.quantity.high)
        keys = {"value": Key(self.quantity, "value"), "sigma": Key(sigma, "standard deviation")}
        return Section(keys, Uncertain)


@dataclass(frozen=True)
class Options:
    """A mapping that is handed on to a library as it is: numbers, true, false, text, lists and
    mappings.
    """

    expected: str = "a mapping of options"

    def read(self, node: Node) -> tuple[dict[str, Any], Node]:
        return {
            name: self._value(item) for name, item in entries(node, self.expected).items()
        }, node

    def _value(self, node: Node) -> Any:
        if isinstance(node, Mapping):
            return self.read(node)[0]
        if isinstance(node, YamlSequence):
            return [self._value(item) for item in node.items]
        return self._scalar(node)

    def _scalar(self, node: Scalar) -> str | int | float | bool:
        if node.tag == "str":
            return node.text
        if node.tag == "bool" and node.text in ("true", "false"):
            return node.text == "true"
        if node.tag == "int" and WHOLE.fullmatch(node.text):
            return int(node.text, 0)
        if node.tag == "float" and units.NUMBER.fullmatch(node.text):
            return float(node.text)

        raise node.place.error(
            describe(node), "a number, true, false, or text (in quotes if YAML reads it otherwise)"
        )


@dataclass(frozen=True)
class Section:
    """A mapping with known keys; `build` makes the value from the keys' values."""

    keys: AnyMapping[str, Key]
    build: Callable[..., Any]
    expected: str = "a mapping"

    def read(self, node: Node) -> tuple[Any, Node]:
        items = entries(node, self.expected, self.keys)

        values: dict[str, Any] = {}
        filled: dict[str, Node] = {}
        for name, key in self.keys.items():
            given = items.get(name) or default(node.place.key(name), key)
            if given is None:
                values[name] = None
            else:
                values[name], filled[name] = key.kind.read(given)

        complete = Mapping(node.place, filled)
        try:
            return self.build(**values), complete
        except Impossible as error:
            raise _blame(error, complete) from None


@dataclass(frozen=True)
class Named:
    """A mapping from names of the user's choosing; `build` makes a value from a name and what
    stands under it.
    """

    kind: Kind
    build: Callable[[str, Any], Any]
    expected: str = "a mapping of names"

    def read(self, node: Node) -> tuple[dict[str, Any], Node]:
        values: dict[str, Any] = {}
        filled: dict[str, Node] = {}
        for name, item in entries(node, self.expected).items():
            if not re.fullmatch(NAMES, name):
                raise item.place.error(
                    f"the name {shown(name)!r}", "letters, digits, '_', '-' or '.', a letter first"
                )
            value, filled[name] = self.kind.read(item)
            values[name] = self.build(name, value)
        return values, Mapping(node.place, filled)


@dataclass(frozen=True)
class Variant:
    """A mapping whose other keys depend on one of them."""

    selector: str
    cases: AnyMapping[str, Section]
    expected: str = "a mapping"

    def read(self, node: Node) -> tuple[Any, Node]:
        selected = entries(node, self.expected).get(self.selector)
        choice = Choice(tuple(self.cases))
        if selected is None:
            raise node.place.key(self.selector).error("nothing", choice.expected)
        case, _ = choice.read(selected)
        return self.cases[case].read(node)


def entries(node: Node, expected: str, known: Iterable[str] | None = None) -> dict[str, Node]:
    """The items of a mapping, all of them known. Raises ConfigError."""
    if not isinstance(node, Mapping):
        raise node.place.error(describe(node), expected)
    names = list(known or node.items)
    for name, item in node.items.items():
        if name not in names:
            options = did_you_mean(name, names, KEYS_ALIKE) or f" (known here: {', '.join(names)})"
            raise item.place.error("an unknown key", f"a known one{options}")
    return node.items


def default(place: FilePosition, key: Key) -> Node | None:
    """The node of a key that is not given; None where it may be absent. Raises ConfigError."""
    if key.default == NEEDED:
        raise place.error("nothing", key.kind.expected)
    return None if key.default == ABSENT else _moved(compose(key.default, place.file), place)


def _moved(node: Node, place: FilePosition) -> Node:
    if isinstance(node, Scalar):
        return Scalar(place, node.text, node.tag)
    if isinstance(node, YamlSequence):
        return YamlSequence(place, tuple(_moved(item, place) for item in node.items))
    return Mapping(
        place, {name: _moved(item, place.key(name)) for name, item in node.items.items()}
    )


def _blame(error: Impossible, section: Mapping) -> Exception:
    """The error line at the key that was named, or at the nearest one above it that is in the
    file.
    """
    node: Node = section
    for name in error.key.split("."):
        if isinstance(node, Mapping) and name in node.items:
            node = node.items[name]
        else:
            return node.place.key(name).error(error.found or "nothing", error.expected)
    return node.place.error(error.found or describe(node), error.expected)


def uncertain(unit: str, **bounds: Any) -> UncertainQuantity:
    """A quantity with its standard deviation, in the unit and bounds of `NumberWithUnit`."""
    return UncertainQuantity(NumberWithUnit(unit, **bounds))
