"""What a file from outside may cost: limits far above what a testbed records, so that no file fills
the memory or takes hours.

The environment variable GRITD_LIMITS raises or lowers them: `GRITD_LIMITS="text=1 GB, chunks=2e6"`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from functools import lru_cache

from gritd.estimator.config.units import UnitError, parse

VARIABLE = "GRITD_LIMITS"
BYTES = ("chunk", "start", "text")


class LimitsError(Exception):
    """GRITD_LIMITS cannot be read: one line."""


@dataclass(frozen=True)
class Limits:
    """Each with what the largest honest file has."""

    chunk: float = 32 * 2**20  # [B] of a recording, unpacked; writers use about 1 MiB
    chunks: float = 500_000  # a day has 432,000, at five a second
    ratio: float = 50  # unpacked to stored, of a recording; of constant readings 15, usually 3
    start: float = 32 * 2**20  # [B] unpacked that the ratio is not asked of
    text: float = 64 * 2**20  # [B] of one file that is imported, unpacked; known logs have 5 MB
    values: float = 4e6  # of one text or spreadsheet: an hour of 11 columns at 100 Hz
    series: float = 1e8  # of one file of time series, those that are used: 2.8 h of 10 at 1 kHz
    conditions: float = 1000  # of a table, each 7 s of a recording; known ones have 189
    ticks: float = 10e6  # built for a recording that has none of its own: 11 h at 250 Hz
    grid: float = 300_000  # points of a recording in a comparison or diagnosis: 8 h at 10 Hz


def limits() -> Limits:
    """The limits, as the environment has them. Raises LimitsError."""
    return _read(os.environ.get(VARIABLE, ""))


def raised(name: str) -> str:
    """How to raise a limit, in words: an example of four times what it is."""
    value = 4.0 * float(getattr(limits(), name))
    text = f"{value:.3g}"
    if name in BYTES:
        text = f"{value / 1e6:.0f} MB" if value > 1e6 else f"{value:.0f} B"
    return f"{VARIABLE}='{name}={text}' raises the limit"


@lru_cache(maxsize=4)
def _read(text: str) -> Limits:
    given = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, _, value = item.partition("=")
        given[name] = _number(name, value)
    return replace(Limits(), **given)


def _number(name: str, text: str) -> float:
    names = [each.name for each in fields(Limits)]
    if name not in names:
        known = ", ".join(names)
        raise LimitsError(f"{VARIABLE}: found {name[:40]!r}; expected NAME=VALUE of {known}")

    unit = "B" if name in BYTES else ""
    try:
        value = parse(text, unit)
    except UnitError as error:
        value, reason = 0.0, f" ({error})"
    else:
        reason = ""

    if not 0.0 < value < 2**53:
        expected = "a number of bytes such as 64 MB" if unit else "a number"
        raise LimitsError(f"{VARIABLE}: {name}: found {text[:40]!r}{reason}; expected {expected}")
    return value
