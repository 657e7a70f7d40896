"""Time as files write it, to nanoseconds: numbers of any unit, dates and times of day in words.

Whole nanoseconds in 64 bits hold every instant from 1678 to 2262; 19 digits stay what they are.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gritd.tools.importers.files import Array

Nanoseconds = NDArray[np.int64]
NS = 1_000_000_000
NONE = np.iinfo(np.int64).min  # where a row has no time
LATEST = 2**63 - 1  # [ns]
EXACT = 2.0**53  # below, a float holds every whole number
DAY, HOUR = 86_400 * NS, 3_600 * NS
EPOCH = date(1970, 1, 1).toordinal()
ORDERS = ("year-month-day", "day-month-year", "month-day-year")
NAMES = "jan|feb|mar mär|apr|may mai|jun|jul|aug|sep|oct okt|nov|dec dez"
MONTHS = {
    name: number for number, names in enumerate(NAMES.split("|"), start=1) for name in names.split()
}
SHOWN = 40  # characters of what was found
MOST = 10_000  # seconds that are remembered

NUMBERED = r"(?P<a>\d{1,4})(?P<mark>[-/.])(?P<b>\d{1,2})(?P=mark)(?P<c>\d{4}|\d{1,2})"
NAMED = r"(?P<day>\d{1,2})[-. ]{1,2}(?P<month>[A-Za-zä]{3,9})[-., ]{1,2}(?P<year>\d{4})"
AMERICAN = r"(?P<month>[A-Za-zä]{3,9})\.? (?P<day>\d{1,2}),? (?P<year>\d{4})"
COMPACT = r"(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)"
DAYS = r"(?:(?P<days>\d{1,5}) days?,? )?"  # of pandas
CLOCK = (
    r"(?P<h>\d{1,3}):(?P<min>\d\d)(?::(?P<s>\d\d)(?:[.,:](?P<part>\d+))?)?(?: ?(?P<half>[AP]M))?"
)
TOGETHER = r"(?P<h>\d\d)(?P<min>\d\d)(?P<s>\d\d)(?:[.,](?P<part>\d+))?(?P<half>)"
MINUTES = r"(?P<h>)(?P<min>\d{1,2}):(?P<s>\d\d)[.,](?P<part>\d+)(?P<half>)"
ZONE = r"(?: ?(?P<zone>Z|UTC|GMT|(?:UTC|GMT)?[+-]\d\d(?::?\d\d)?))?"
WEEKDAY = r"(?:[A-Za-z]{2,9}\.?,? )?"
FORMS = {
    kind: re.compile(pattern, re.IGNORECASE)
    for kind, pattern in {
        "numbered": rf"{WEEKDAY}(?P<date>{NUMBERED})(?:[T /_:,-]{{1,2}}{CLOCK}{ZONE})?",
        "named": rf"{WEEKDAY}(?P<date>{NAMED})(?:[T /_:,-]{{1,2}}{CLOCK}{ZONE})?",
        "american": rf"{WEEKDAY}(?P<date>{AMERICAN})(?:[T /_:,-]{{1,2}}{CLOCK}{ZONE})?",
        "compact": rf"(?P<date>{COMPACT})(?:[T _-]?{TOGETHER}{ZONE})?",
        "of day": rf"{DAYS}{CLOCK}{ZONE}",
        "of hour": MINUTES,
    }.items()
}
FAR = (
    "292 years or more; expected a finer unit of time, ms, us or ns; of MATLAB's datenum "
    "(t - 719529) * 86400, in s"
)
PERIODS = {"of day": DAY, "of hour": HOUR}


class TimeFormatError(ValueError):
    """A time that cannot be read: what was found and what is expected; `at` is its place."""

    def __init__(self, message: str, at: int = 0) -> None:
        super().__init__(message)
        self.at = at


# --- words ---


@dataclass(frozen=True)
class TimeFormat:
    """How a column of dates or times of day is written.

    form: one of FORMS. order: one of ORDERS, where the date is three numbers.
    """

    form: str
    order: str = ORDERS[0]
    met: dict[str, int] = field(default_factory=dict, compare=False)  # seconds of earlier rows

    @property
    def period(self) -> int:
        """After how many ns the times begin again; 0 of dates."""
        return PERIODS.get(self.form, 0)

    def read(self, words: Sequence[str]) -> Nanoseconds:
        """Since 1970, as UTC where no zone is named; or since midnight, or since the full hour,
        shape (n,). NONE where a word is a gap. Raises TimeFormatError.
        """
        made = np.empty(len(words), dtype=np.int64)
        for at, word in enumerate(words):
            second, _, part = word.rpartition("." if "." in word[-10:] else ",")
            if second in self.met and part.isdigit():
                made[at] = self.met[second] + _fraction(part)
            else:
                made[at] = self._read(word.strip(), at)
        return made

    def _read(self, word: str, at: int) -> int:
        match = FORMS[self.form].fullmatch(word)
        if match is None:
            if is_gap(word):
                return int(NONE)
            raise TimeFormatError(f"found {word[:SHOWN]!r}; expected {self.example}", at)

        try:
            instant = self._instant(match)
        except (ValueError, OverflowError, KeyError):
            raise TimeFormatError(
                f"found {word[:SHOWN]!r}, which is no time; expected {self.example}", at
            ) from None
        self._remember(match, instant)
        return instant

    def _remember(self, match: re.Match[str], instant: int) -> None:
        """The second, where its fraction ends the word: most rows share it with others."""
        part = match["part"]
        if part and match.end("part") == len(match.string) and match["s"]:
            if len(self.met) > MOST:
                self.met.clear()
            self.met[match.string[: match.start("part") - 1]] = instant - _fraction(part)

    @property
    def example(self) -> str:
        """The form in words."""
        if self.form == "numbered":
            return f"a date by {self.order}, as in the first rows"
        return f"a time {self.form}" if self.period else "a date as in the first rows"

    def _instant(self, match: re.Match[str]) -> int:
        seconds = _seconds(match["h"], match["min"], match["s"], match["half"]) * NS
        instant = seconds + _fraction(match["part"] or "0")
        if self.period:
            return instant + int(match.groupdict().get("days") or 0) * DAY
        if instant > DAY:
            raise ValueError
        day = (_date(match, self.order).toordinal() - EPOCH) * DAY
        return _checked(day + instant - _zone(match["zone"]), match.string, 0)


def clock(words: Sequence[str], order: str = "") -> TimeFormat:
    """How a column is written, from some of its words; `order` as the map states it, or ''.

    Four digits first are a year; where dots stand the day is first. Otherwise a number beyond 12
    must tell the day from the month. Raises TimeFormatError where nothing does.
    """
    known = [word.strip() for word in words if not is_gap(word)]
    if not known:
        raise TimeFormatError("found no time; expected a date or a time of day in every row")

    form = next((name for name, form in FORMS.items() if form.fullmatch(known[0])), None)
    if form is None:
        raise TimeFormatError(
            f"found {known[0][:SHOWN]!r}; expected a date such as 2026-11-22T14:03:05.250 or a "
            "time such as 14:03:05.250; numbers need their unit in the map"
        )
    if form != "numbered":
        return TimeFormat(form)

    matches = [match for word in known if (match := FORMS[form].fullmatch(word))]
    return TimeFormat(form, order or _order(matches))


def _order(matches: Sequence[re.Match[str]]) -> str:
    first = matches[0]
    if len(first["a"]) == 4:
        return ORDERS[0]
    if first["mark"] == ".":
        return ORDERS[1]

    later = (max(int(match["a"]) for match in matches), max(int(match["b"]) for match in matches))
    if later[0] > 12 >= later[1]:
        return ORDERS[1]
    if later[1] > 12 >= later[0]:
        return ORDERS[2]
    raise TimeFormatError(
        f"found {first[0][:SHOWN]!r}, which has the day or the month first; "
        f"expected order: {ORDERS[1]}, or {ORDERS[2]}, in the map"
    )


def _date(match: re.Match[str], order: str) -> date:
    """Raises ValueError, KeyError where there is no such day."""
    groups = match.groupdict()
    if "mark" not in groups:
        month = groups["month"]
        return date(
            int(groups["year"]),
            int(month) if month.isdigit() else MONTHS[month[:3].lower()],
            int(groups["day"]),
        )

    named = dict(zip(order.split("-"), (groups["a"], groups["b"], groups["c"]), strict=True))
    year = int(named["year"])
    return date(year + 2000 * (len(named["year"]) <= 2), int(named["month"]), int(named["day"]))


def _fraction(part: str) -> int:
    """Digits behind the second's mark [ns]."""
    return int(part[:9].ljust(9, "0"))


def _seconds(hour: str | None, minute: str | None, second: str | None, half: str | None) -> int:
    """Raises ValueError where a clock shows no such time."""
    h, m, s = (int(text or 0) for text in (hour, minute, second))
    if half:
        if not 1 <= h <= 12:
            raise ValueError
        h = h % 12 + 12 * (half.upper() == "PM")
    if m > 59 or s > 60:
        raise ValueError
    return h * 3600 + m * 60 + s


def _zone(text: str | None) -> int:
    """East of Greenwich [ns]."""
    digits = re.search(r"([+-])(\d\d):?(\d\d)?", text or "")
    if digits is None:
        return 0
    east = int(digits[2]) * HOUR + int(digits[3] or 0) * 60 * NS
    return -east if digits[1] == "-" else east


def unwrapped(instants: Nanoseconds, period: int) -> Nanoseconds:
    """Times (n,) that begin again after a period [ns], such as midnight, made to go on."""
    past = np.concatenate(([0], np.cumsum(np.diff(instants) < -period // 2)))
    return np.asarray(instants + period * past, dtype=np.int64)


# --- numbers ---


def per_unit(factor: Fraction) -> int:
    """[ns] of a unit of time whose factor to seconds is given. Raises TimeFormatError for one that
    is no whole number of them.
    """
    whole = factor * NS
    if whole.denominator != 1:
        raise TimeFormatError("found a unit finer than ns; expected ns or longer")
    return int(whole)


def of_texts(words: Sequence[str], unit: int) -> Nanoseconds:
    """Numbers in a unit of so many ns, to the last digit that is written, shape (n,); NONE where a
    word is a gap. Raises TimeFormatError.
    """
    try:
        values = np.array(list(map(float, words)))
        if (made := of_floats(values, unit)) is not None:
            return made
        if float(np.max(np.abs(values))) * unit < 0.999 * LATEST:
            return np.array(list(map(int, words)), dtype=np.int64) * unit
    except ValueError:  # a gap, a decimal comma, a fraction with many digits
        pass
    return np.array([_exact(word, unit, at) for at, word in enumerate(words)], dtype=np.int64)


def of_floats(values: Array, unit: int) -> Nanoseconds | None:
    """Numbers (n,) in a unit of so many ns; None where any is none, or too large to be exact."""
    if not float(np.max(np.abs(values), initial=0.0)) * unit < EXACT:
        return None
    return np.round(values * unit).astype(np.int64)


def _exact(word: str, unit: int, at: int) -> int:
    text = word.strip().translate(FOREIGN)
    if is_gap(text):
        return int(NONE)

    whole, _, part = text.partition(".")
    try:
        if (whole + part).lstrip("+-").isdigit():
            scale = 10 ** len(part)
            value = (int(whole + part) * unit * 2 + scale) // (2 * scale)
        else:
            value = round(Fraction(text) * unit) if len(text) < SHOWN else LATEST + 1
    except (ValueError, ZeroDivisionError):
        raise TimeFormatError(
            f"found {word[:SHOWN]!r}; expected a number, or unit: clock for dates and times of day",
            at,
        ) from None
    return _checked(value, word, at)


def _checked(value: int, word: str, at: int) -> int:
    if abs(value) > LATEST:
        raise TimeFormatError(f"found {word[:SHOWN]!r}, {FAR}", at)
    return value


def of_numbers(values: Array | Nanoseconds, unit: int) -> Nanoseconds:
    """Numbers (n,) in a unit of so many ns, NONE where there is none; those of 64-bit integers stay
    exact. Raises TimeFormatError.
    """
    known = np.isfinite(values)
    far = known & (np.abs(values.astype(np.float64)) * unit > 0.999 * LATEST)
    if np.any(far):
        at = int(np.argmax(far))
        raise TimeFormatError(f"found {values[at]:.15g}, {FAR}", at)

    if values.dtype.kind in "iu":
        return values.astype(np.int64) * unit
    whole = np.floor(np.where(known, values, 0.0))
    part = np.round((np.where(known, values, 0.0) - whole) * unit)
    made = whole.astype(np.int64) * unit + part.astype(np.int64)
    return np.where(known, made, NONE)


# --- gaps ---

FOREIGN = str.maketrans(
    {",": ".", "\N{MINUS SIGN}": "-", "D": "E", "d": "e"}
)  # 1,5 or Fortran's 1.0D+3

GAPS = frozenset(["nan", "na", "n/a", "null", "none", "nil", "nat", "-", "--", "inf", "infinity"])


def is_gap(word: str) -> bool:
    """Whether a cell holds nothing: empty, NaN, or what spreadsheets and compilers write instead of
    a number (#N/A, #DIV/0!, 1.#IND, -nan(ind)).
    """
    text = word.strip().lower()
    return (
        not text
        or text in GAPS
        or text.startswith("#")
        or text.lstrip("+-") in GAPS
        or text.lstrip("+-").startswith(("nan(", "1.#"))
    )


def likely_unit(values: Array) -> str:
    """The unit in which numbers (n,) are a time since 1970 between 2000 and 2100, or ''."""
    known = np.abs(values[np.isfinite(values)])
    middle = float(np.median(known)) if known.size else 0.0
    size = math.log10(middle) if middle > 0.0 else 0.0
    exponents = {"s": 0, "ms": 3, "us": 6, "ns": 9}
    return next((u for u, e in exponents.items() if 8.97 < size - e < 9.62), "")
