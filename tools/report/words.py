"""Quantities and sentences of a report, as a person reads them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from gritd.tools.cli.wording import (
    NOTHING,
    SCIENTIFIC,
    fixed,
    listed,
    magnitude,
    number,
    shown,
    spaced,
    spelled,
)
from gritd.tools.diagnose.explain.result import SOIL, Quantity

FEW = 3  # names are said, of more their number
LARGE = 0.3  # [m] lengths from here on are read in metres
HELD = re.compile(r"(?<=[0-9±<>]) (?=[0-9±%σ°]|(?:N|m|mm|s|Pa|kPa|nats)\b)|(?<=[0-9]) (?=±)")
NAMED = re.compile(r"\S+\.\w")  # run-1.mcap, wheel.radius


def name_of(key: str) -> str:
    """A channel, effect, soil parameter or covariate in words."""
    return SOIL.get(key) or spelled(key)


def held(words: str) -> str:
    """Numbers and their units are not parted at the end of a line."""
    return HELD.sub("\N{NO-BREAK SPACE}", words)


def sentence(words: str) -> str:
    """With a capital and a full stop; a file's name or a key that it begins with stays as it is."""
    words = stopped(words)
    return words if NAMED.match(words) else words[:1].upper() + words[1:]


def stopped(words: str) -> str:
    """With a full stop."""
    words = held(words.strip())
    return words + ("" if words.endswith((".", "!", "?")) or not words else ".")


def quantity(q: Quantity | None) -> str:
    """value ± sigma unit, as many digits as the uncertainty deserves (two of its own)."""
    if q is None or not math.isfinite(q.value):
        return NOTHING
    unit, factor = _unit_for(q)
    value, sigma = q.value * factor, q.sigma * factor
    return (
        f"{uncertain(value, sigma)} {unit}".rstrip()
        if unit != "°"
        else f"{uncertain(value, sigma)}°"
    )


def _unit_for(q: Quantity) -> tuple[str, float]:
    small = q.unit != "m" or abs(q.value) < LARGE
    return shown(q.unit) if small else ("m", 1.0)


def uncertain(value: float, sigma: float) -> str:
    """value ± sigma, unit already shown."""
    if not (math.isfinite(sigma) and sigma > 0.0):
        return number(value, 4)
    if not (SCIENTIFIC[0] / 10 <= sigma and max(abs(value), sigma) < SCIENTIFIC[1]):
        return f"{number(value)} ± {number(sigma, 2)}"
    places = min(max(1 - magnitude(sigma), 0), 6)
    return f"{fixed(value, places)} ± {fixed(sigma, places)}"


def probability(p: float | None) -> str:
    """A p-value: small ones as a bound."""
    if p is None or not math.isfinite(p):
        return NOTHING
    return "< 0.001" if p < 0.001 else number(p, 2)


def with_unit(value: float | None, unit: str, digits: int = 3) -> str:
    """A value inside, in the unit it is shown in."""
    seen, factor = shown(unit)
    return spaced(None if value is None else value * factor, seen, digits)


def nats(value: float | None) -> str:
    """Evidence: whole nats, tenths where they matter."""
    return (
        NOTHING
        if value is None or not math.isfinite(value)
        else f"{fixed(value, int(abs(value) < 10.0))} nats"
    )


def counted(count: int, what: str) -> str:
    """1 run, 2 runs."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def to_tell(verdict: str, names: Sequence[str]) -> str:
    """What an experiment would do about some effects, by the verdict that asked for it."""
    if verdict == "insufficient":
        return f"it would show {listed(names) if len(names) <= FEW else f'{len(names)} effects'}"
    if verdict == "unlisted":
        return f"it would distinguish {listed(names)} from what is not listed"
    return f"it would distinguish {listed(names)}"
