"""Kinds of configuration values. Each reads a YAML node into a value and says, in words, what it
expects.

A `Section` is a table of keys; parsing, defaults, error lines and the key reference all come
from it. Reading returns the value and the node completed with the defaults, so that the
effective configuration is a by-product.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from gritd.estimator.config import units
from gritd.estimator.config.settings import Uncertain
from gritd.estimator.config.yamltree import (
    Mapping,
    Node,
    Place,
    Scalar,
    Sequence,
    compose,
    describe,
    shown,
)

NEEDED = "\0needed"
ABSENT = "\0absent"  # may be left out, and then there is none
UNLIMITED = "unlimited"

SMALLEST, LARGEST = 1e-12, 1e12  # of a quantity in SI units; beyond, squares lose their digits
LARGEST_COUNT = 1e18  # of one that may be unlimited
WHOLE = re.compile(r"-?(0|[1-9][0-9]{0,18})|0x[0-9a-fA-F]{1,16}")


class Kind(Protocol):
    """One kind of value."""

    @property
    def expected(self) -> str:
        """What the kind accepts, in words."""

    def read(self, node: Node) -> tuple[Any, Node]:
        """Value and completed node. Raises ConfigError."""


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
class Quantity:
    """A number with a unit of the same kind as `unit`; a plain number where `unit` is empty; any
    where it is None.
    """

    unit: str | None
    above: float = -math.inf
    low: float = -math.inf
    high: float = math.inf
    unlimited: bool = False

    @property
    def expected(self) -> str:
        kinds = {None: "a number or a quantity", "": "a number"}
        unlimited = f", or {UNLIMITED}" if self.unlimited else ""
        return f"{kinds.get(self.unit, f'a quantity in {self.unit}')}{self._bounds()}{unlimited}"

    def _bounds(self) -> str:
        suffix = f" {self.unit}" if self.unit else ""
        bounds = (
            (" above", self.above),
            (" from", self.low),
            (" to" if self.low > -math.inf else " up to", self.high),
        )
        return "".join(
            f"{word} {bound:g}{suffix}" for word, bound in bounds if math.isfinite(bound)
        )

    def read(self, node: Node) -> tuple[float, Node]:
        text = _scalar(node, self.expected)
        if self.unlimited and text == UNLIMITED:
            return math.inf, node
        value = self._si(node, text)
        if not self.holds(value):
            raise node.place.error(shown(text), self.expected + self._reason(value))
        return value, node

    def holds(self, value: float) -> bool:
        """Whether a value is inside the bounds, and of a size that can be calculated with."""
        return not self._reason(value) and self.above < value and self.low <= value <= self.high

    def _reason(self, value: float) -> str:
        """Why no quantity of a testbed has such a size; '' as a rule."""
        if value == 0.0 or SMALLEST <= abs(value) <= (LARGEST_COUNT if self.unlimited else LARGEST):
            return ""
        return f", of a size from {SMALLEST:g} to {LARGEST:g} in SI units"

    def _si(self, node: Node, text: str) -> float:
        try:
            self._refuse_text(node, text)
            return units.parse_any(text) if self.unit is None else units.parse(text, self.unit)
        except units.UnitError as error:
            raise node.place.error(f"{describe(node)} ({error})", self.expected) from None

    def _refuse_text(self, node: Node, text: str) -> None:
        """A number that YAML takes for text: 1e3 for want of point and sign, or one in quotes."""
        if (
            units.NUMBER.fullmatch(text)
            and isinstance(node, Scalar)
            and node.tag == "str"
            and not self.unit
        ):
            how = "1.0e+3" if "e" in text.lower() else "it without quotes"
            raise node.place.error(
                f"{shown(text)}, which YAML reads as text", f"{self.expected}: write {how}"
            )


@dataclass(frozen=True)
class UncertainQuantity:
    """A quantity, or a mapping of value and sigma. The plain form has sigma 0."""

    quantity: Quantity

    @property
    def expected(self) -> str:
        return f"{self.quantity.expected}, or {{value, sigma}}"

    def read(self, node: Node) -> tuple[Uncertain, Node]:
        if not isinstance(node, Mapping):
            if isinstance(node, Sequence):
                raise node.place.error(describe(node), self.expected)
            value, _ = self.quantity.read(node)
            return Uncertain(value), node
        sigma = Quantity(self.quantity.unit, low=0.0, high=self.quantity.high)
        keys = {"value": Key(self.quantity, "value"), "sigma": Key(sigma, "standard deviation")}
        return Section(keys, Uncertain).read(node)


@dataclass(frozen=True)
class Interval:
    """A list of two quantities, the first below the second."""

    quantity: Quantity

    @property
    def expected(self) -> str:
        return f"[low, high], each {self.quantity.expected}"

    def read(self, node: Node) -> tuple[tuple[float, float], Node]:
        if not isinstance(node, Sequence) or len(node.items) != 2:
            raise node.place.error(describe(node), self.expected)
        low, high = (self.quantity.read(item)[0] for item in node.items)
        if low >= high:
            ends = ", ".join(shown(item.text) for item in node.items if isinstance(item, Scalar))
            raise node.place.error(f"[{ends}]", "the low end below the high end")
        return (low, high), node


@dataclass(frozen=True)
class Integer:
    low: int
    high: int

    @property
    def expected(self) -> str:
        return f"a whole number from {self.low} to {self.high}"

    def read(self, node: Node) -> tuple[int, Node]:
        text = _scalar(node, self.expected)
        if (
            not WHOLE.fullmatch(text)
            or _tag(node) != "int"
            or not self.low <= int(text, 0) <= self.high
        ):
            raise node.place.error(describe(node), self.expected)
        return int(text, 0), node


@dataclass(frozen=True)
class Flag:
    expected: str = "true or false"

    def read(self, node: Node) -> tuple[bool, Node]:
        text = _scalar(node, self.expected)
        if _tag(node) != "bool" or text not in ("true", "false"):
            raise node.place.error(describe(node), self.expected)
        return text == "true", node


@dataclass(frozen=True)
class Text:
    """Text that YAML too reads as text; `no` or 12 need quotes."""

    what: str = "text"
    pattern: str = r"[^\r\n]*"

    @property
    def expected(self) -> str:
        return self.what

    def read(self, node: Node) -> tuple[str, Node]:
        text = _scalar(node, self.expected)
        if (
            _tag(node) not in ("str", "timestamp")
            or not re.fullmatch(self.pattern, text)
            or not text.isprintable()
        ):
            quotes = "" if _tag(node) in ("str", "null") else " in quotes"
            raise node.place.error(describe(node), self.expected + quotes)
        return text, node


@dataclass(frozen=True)
class FilePath:
    """A path. A relative one counts from the folder and stands absolute in the effective
    configuration.
    """

    folder: Path | None
    expected: str = "a path"

    def read(self, node: Node) -> tuple[str, Node]:
        text, _ = Text(self.expected).read(node)
        path = str(self.folder / text) if self.folder and text else text
        return path, Scalar(node.place, path, "str")


@dataclass(frozen=True)
class Choice:
    words: tuple[str, ...]

    @property
    def expected(self) -> str:
        return "one of " + ", ".join(self.words)

    def read(self, node: Node) -> tuple[str, Node]:
        text = _scalar(node, self.expected)
        if text not in self.words:
            raise node.place.error(describe(node) + nearest(text, self.words), self.expected)
        return text, node


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
        if isinstance(node, Sequence):
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
            if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_.-]{0,63}", name):
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
            options = nearest(name, names) or f" (known here: {', '.join(names)})"
            raise item.place.error("an unknown key", f"a known one{options}")
    return node.items


def nearest(word: str, words: Iterable[str]) -> str:
    """A hint at the known word that resembles this one most, or nothing."""
    close = difflib.get_close_matches(word[:64], list(words), n=1)
    return f" (did you mean {close[0]}?)" if close else ""


def default(place: Place, key: Key) -> Node | None:
    """The node of a key that is not given; None where it may be absent. Raises ConfigError."""
    if key.default == NEEDED:
        raise place.error("nothing", key.kind.expected)
    return None if key.default == ABSENT else _moved(compose(key.default, place.file), place)


def _moved(node: Node, place: Place) -> Node:
    if isinstance(node, Scalar):
        return Scalar(place, node.text, node.tag)
    if isinstance(node, Sequence):
        return Sequence(place, tuple(_moved(item, place) for item in node.items))
    return Mapping(
        place, {name: _moved(item, place.key(name)) for name, item in node.items.items()}
    )


def _scalar(node: Node, expected: str) -> str:
    if not isinstance(node, Scalar):
        raise node.place.error(describe(node), expected)
    return node.text


def _tag(node: Node) -> str:
    return node.tag if isinstance(node, Scalar) else ""


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
    """A quantity with its standard deviation, in the unit and bounds of `Quantity`."""
    return UncertainQuantity(Quantity(unit, **bounds))
