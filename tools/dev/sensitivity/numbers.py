"""The tuned numbers, halved and doubled, and what notices that one is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from typing import Any

from gritd.tools.diagnose.tuning import TUNING

ODDS = ("share", "probability")  # units of numbers that stay below 1
FIXED = ("prior", "choice")  # units of what is not a size
FACTORS = (0.5, 2.0)


@dataclass(frozen=True, order=True)
class Field:
    """A tuned number of a room."""

    room: str
    name: str

    def __str__(self) -> str:
        return f"{self.room}.{self.name}"

    @property
    def value(self) -> Any:
        return getattr(getattr(TUNING, self.room), self.name)

    @property
    def unit(self) -> str:
        """As the room's numbers state it."""
        stage = getattr(TUNING, self.room)
        return str(next(f.metadata["unit"] for f in fields(stage) if f.name == self.name))

    def factors(self) -> list[float]:
        """Those that make another value of it."""
        if self.unit in FIXED:
            return []
        return [f for f in FACTORS if changed(self.value, self.unit, f) != self.value]


def every_field() -> list[Field]:
    """All tuned numbers, in the order of the rooms."""
    rooms = [f.name for f in fields(TUNING)]
    return [Field(room, f.name) for room in rooms for f in fields(getattr(TUNING, room))]


def named(text: str) -> Field:
    """The number ROOM.NAME. Raises ValueError if there is none."""
    field = next((f for f in every_field() if str(f) == text), None)
    if field is None:
        raise ValueError(f"found no number {text}")
    return field


def changed(value: Any, unit: str, factor: float) -> Any:
    """A number, or all numbers of a tuple or a mapping, times a factor; whole numbers rounded, one
    at least. Shares and probabilities change in their odds, quantiles in the odds of their tail.
    """
    if isinstance(value, Mapping):
        return {name: changed(each, unit, factor) for name, each in value.items()}
    if isinstance(value, tuple):
        return tuple(changed(each, unit, factor) for each in value)

    if isinstance(value, int):
        return max(math.floor(value * factor + 0.5), 1)
    if unit == "quantile" and value > 0.5:
        return 1.0 - _in_odds(1.0 - value, factor)
    return _in_odds(value, factor) if unit in (*ODDS, "quantile") else value * factor


def _in_odds(share: float, factor: float) -> float:
    return share * factor / (1.0 - share + share * factor)


class Watched:
    """Stands for a room's numbers, and tells of each before it is read."""

    def __init__(self, room: str, numbers: Any, reading: Callable[[Field], None]) -> None:
        self._room, self._numbers, self._reading = room, numbers, reading

    def __getattr__(self, name: str) -> Any:
        computed = getattr(type(self._numbers), name, None)
        if isinstance(computed, property) and computed.fget:
            return computed.fget(self)
        self._reading(Field(self._room, name))
        return getattr(self._numbers, name)

    def _change(self, name: str, value: Any) -> None:
        """Another number in its place. Who holds the room already reads it, too."""
        self._numbers = replace(self._numbers, **{name: value})


@contextmanager
def watched(reading: Callable[[Field], None]) -> Iterator[Callable[[Field, Any], None]]:
    """All rooms watched for a while. Gives what puts another number in place of one."""
    before = {f.name: getattr(TUNING, f.name) for f in fields(TUNING)}
    rooms = {room: Watched(room, numbers, reading) for room, numbers in before.items()}
    try:
        for room, watch in rooms.items():
            setattr(TUNING, room, watch)
        yield lambda field, value: rooms[field.room]._change(field.name, value)
    finally:
        for room, numbers in before.items():
            setattr(TUNING, room, numbers)
