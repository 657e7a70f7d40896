"""Quantities written as text, such as `72 mm` or `1523.4 kN/m^(n+2)`, to SI: one small table.

A unit is a product of powers: symbols joined by `*`, `·` or `/` (read from the left), a whole
power after `^`, `sqrt(s)` for random walks, and `1` to start a reciprocal. Symbols are those of
SYMBOLS, most with an SI prefix. The exponent n of the pressure-sinkage law may stand in a power
of the metre: `kN/m^(n+1)`. Angles and counts are dimensions of their own, so that mrad/count is
not taken for mm/count.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

# base -> (fixed power, power's coefficient of n); a base with both zero is left out
Dimension = dict[str, tuple[Fraction, int]]

PREFIXES = {
    "n": -9,
    "u": -6,
    "µ": -6,
    "μ": -6,
    "m": -3,
    "c": -2,
    "k": 3,
    "M": 6,
    "G": 9,
}  # micro: U+00B5 and U+03BC

# symbol -> (factor to SI, dimension as powers of the bases, may take a prefix)
SYMBOLS: dict[str, tuple[Fraction, dict[str, int], bool]] = {
    "m": (Fraction(1), {"m": 1}, True),
    "g": (Fraction(1, 1000), {"kg": 1}, True),
    "s": (Fraction(1), {"s": 1}, True),
    "min": (Fraction(60), {"s": 1}, False),
    "h": (Fraction(3600), {"s": 1}, False),
    "d": (Fraction(86400), {"s": 1}, False),
    "A": (Fraction(1), {"A": 1}, True),
    "K": (Fraction(1), {"K": 1}, True),
    "degC": (
        Fraction(1),
        {"degC": 1},
        False,
    ),  # a reading of the Celsius scale; differences are in K
    "rad": (Fraction(1), {"rad": 1}, True),
    "deg": (Fraction(math.pi) / 180, {"rad": 1}, False),
    "turn": (Fraction(math.pi) * 2, {"rad": 1}, False),
    "rpm": (Fraction(math.pi) / 30, {"rad": 1, "s": -1}, False),
    "count": (Fraction(1), {"count": 1}, False),
    "B": (Fraction(1), {"B": 1}, True),  # byte
    "%": (Fraction(1, 100), {}, False),
    "Hz": (Fraction(1), {"s": -1}, True),
    "N": (Fraction(1), {"kg": 1, "m": 1, "s": -2}, True),
    "Pa": (Fraction(1), {"kg": 1, "m": -1, "s": -2}, True),
    "J": (Fraction(1), {"kg": 1, "m": 2, "s": -2}, True),
    "W": (Fraction(1), {"kg": 1, "m": 2, "s": -3}, True),
    "V": (Fraction(1), {"kg": 1, "m": 2, "s": -3, "A": -1}, True),
    "ohm": (Fraction(1), {"kg": 1, "m": 2, "s": -3, "A": -2}, True),
}

NUMBER = re.compile(
    r"[+-]?(?:(?:0|[1-9][0-9]{0,24})(?:\.[0-9]{0,24})?|\.[0-9]{1,24})(?:[eE][+-]?[0-9]{1,3})?"
)
TERM = re.compile(r"(?P<symbol>[A-Za-zµμ%]+|1)(?:\^(?P<power>-?[1-9]|n|\(n(?P<plus>[+-][1-9])\)))?")
ROOT_SECOND = "sqrt(s)"
LONGEST = 80  # characters of a quantity


class UnitError(ValueError):
    """The text is not a quantity of the unit that is wanted."""


@dataclass(frozen=True)
class Unit:
    """A factor to SI and a dimension."""

    factor: Fraction
    dimension: Dimension


@lru_cache(maxsize=256)
def unit(text: str) -> Unit:
    """The unit a text names; the empty text is the dimensionless one. Raises UnitError."""
    factor = Fraction(1)
    dimension: Dimension = {}
    if text:
        for sign, term in _terms(text):
            power = _term(term)
            factor *= power.factor**sign
            dimension = _multiply(dimension, power.dimension, sign)
    return Unit(factor, dimension)


def parse(text: str, expected: str) -> float:
    """The SI value of a quantity whose dimension is that of the unit `expected`. Raises
    UnitError.
    """
    number, suffix = split(text)
    given = unit(suffix)
    if given.dimension != unit(expected).dimension:
        raise UnitError(_mismatch(suffix, expected))
    return _scaled(number, given.factor)


def _mismatch(suffix: str, expected: str) -> str:
    """Why a quantity of the unit `suffix` is none of the unit `expected`; one may be empty."""
    if not suffix:
        return "its unit is missing"
    if not expected:
        return f"this quantity has no unit, not {suffix}"
    return f"{suffix} is not a unit of the same kind as {expected}"


def parse_any(text: str) -> float:
    """The SI value of a quantity of any dimension. Raises UnitError."""
    number, suffix = split(text)
    return _scaled(number, unit(suffix).factor)


def split(text: str) -> tuple[str, str]:
    """Number and unit of a quantity, as written. Raises UnitError."""
    match = NUMBER.match(text)
    if len(text) > LONGEST or not match:
        raise UnitError("not a number with a unit")
    number, suffix = match.group(), text[match.end() :]
    if suffix and not re.fullmatch(r" ?[^\s].*", suffix):
        raise UnitError("more than one space between number and unit")
    return number, suffix.strip(" ")


def _scaled(number: str, factor: Fraction) -> float:
    """number · factor, rounded once: 72 mm is exactly the float 0.072."""
    try:
        return float(Fraction(number) * factor)
    except OverflowError:
        raise UnitError("too large for a number") from None


def _terms(text: str) -> list[tuple[int, str]]:
    """The factors of a product with the sign of their power."""
    pieces = re.split(r"([*·/])", text)
    signs = [1, *(-1 if operator == "/" else 1 for operator in pieces[1::2])]
    return list(zip(signs, (piece.strip(" ") for piece in pieces[0::2]), strict=True))


def _term(text: str) -> Unit:
    """One symbol with its power."""
    if text == ROOT_SECOND:
        return Unit(Fraction(1), {"s": (Fraction(1, 2), 0)})

    match = TERM.fullmatch(text)
    if not match:
        raise UnitError(f"unknown unit {text!r}")

    base = _symbol(match["symbol"])
    power = match["power"]
    if power is None:
        return base
    if "n" in power:
        return _symbolic(match["symbol"], int(match["plus"] or 0))

    whole = int(power)
    return Unit(
        base.factor**whole,
        {name: (fixed * whole, n) for name, (fixed, n) in base.dimension.items()},
    )


def _symbol(symbol: str) -> Unit:
    """A symbol of the table, with or without prefix; `1` is the empty product."""
    if symbol == "1":
        return Unit(Fraction(1), {})

    if symbol in SYMBOLS:
        factor, powers, _ = SYMBOLS[symbol]
    elif symbol[0] in PREFIXES and symbol[1:] in SYMBOLS and SYMBOLS[symbol[1:]][2]:
        factor, powers, _ = SYMBOLS[symbol[1:]]
        factor *= Fraction(10) ** PREFIXES[symbol[0]]
    else:
        raise UnitError(f"unknown unit {symbol!r}")

    return Unit(factor, {name: (Fraction(power), 0) for name, power in powers.items()})


def _symbolic(symbol: str, plus: int) -> Unit:
    """m^(n+plus). A prefixed metre would make the factor depend on n, so only the metre itself
    may carry it.
    """
    if symbol != "m":
        raise UnitError(f"a power with n belongs to m alone, not to {symbol!r}")
    return Unit(Fraction(1), {"m": (Fraction(plus), 1)})


def _multiply(left: Dimension, right: Dimension, sign: int) -> Dimension:
    product = dict(left)
    for base, (fixed, n) in right.items():
        have, have_n = product.pop(base, (Fraction(0), 0))
        fixed, n = have + sign * fixed, have_n + sign * n
        if fixed or n:
            product[base] = (fixed, n)
    return product
