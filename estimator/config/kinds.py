"""Kinds of single values. Each reads a YAML node into a value and says in words what it
expects.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from gritd.estimator.config import units
from gritd.estimator.config.nearest import KEYS_ALIKE, did_you_mean, listed
from gritd.estimator.config.yamltree import Node, Scalar, YamlSequence, describe, shown

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


@dataclass(frozen=True)
class NumberWithUnit:
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
        text = scalar(node, self.expected)
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
class Interval:
    """A list of two quantities, the first below the second."""

    quantity: NumberWithUnit

    @property
    def expected(self) -> str:
        return f"[low, high], each {self.quantity.expected}"

    def read(self, node: Node) -> tuple[tuple[float, float], Node]:
        if not isinstance(node, YamlSequence) or len(node.items) != 2:
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
        text = scalar(node, self.expected)
        if (
            not WHOLE.fullmatch(text)
            or tag(node) != "int"
            or not self.low <= int(text, 0) <= self.high
        ):
            raise node.place.error(describe(node), self.expected)
        return int(text, 0), node


@dataclass(frozen=True)
class YesNo:
    expected: str = "true or false"

    def read(self, node: Node) -> tuple[bool, Node]:
        text = scalar(node, self.expected)
        if tag(node) != "bool" or text not in ("true", "false"):
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
        text = scalar(node, self.expected)
        if (
            tag(node) not in ("str", "timestamp")
            or not re.fullmatch(self.pattern, text)
            or not text.isprintable()
        ):
            quotes = "" if tag(node) in ("str", "null") else " in quotes"
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
        return f"one of {listed(self.words)}"

    def read(self, node: Node) -> tuple[str, Node]:
        text = scalar(node, self.expected)
        if text not in self.words:
            raise node.place.error(
                describe(node) + did_you_mean(text, self.words, KEYS_ALIKE), self.expected
            )
        return text, node


def scalar(node: Node, expected: str) -> str:
    if not isinstance(node, Scalar):
        raise node.place.error(describe(node), expected)
    return node.text


def tag(node: Node) -> str:
    return node.tag if isinstance(node, Scalar) else ""


@dataclass(frozen=True)
class Either:
    """A word, read as None, or a value of another kind."""

    word: str
    other: Kind

    @property
    def expected(self) -> str:
        return f"{self.word}, or {self.other.expected}"

    def read(self, node: Node) -> tuple[Any, Node]:
        if isinstance(node, Scalar) and node.text == self.word:
            return None, node
        return self.other.read(node)
