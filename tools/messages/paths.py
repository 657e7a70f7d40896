"""Fields of nested messages by their path: `wrench.force.x`, `q[0]`, `position[wheel]`.

An index is a number, or a name: of the message's own list of names (`name` of JointState), or what
the `name` of an element is.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

STEP = re.compile(r"([^.\[\]]+)(?:\[([^\]]*)\])?(?:\.|$)")
NAMES = ("name", "names", "joint_names")  # fields that name the elements of the arrays beside them
# fields of a time
TIMES = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"))
MOST = 64  # elements of an array that get names of their own; a longer one is no set of channels
NS = 1_000_000_000

Getter = Callable[[Any], float]


def getter(path: str) -> Getter:
    """What takes a number out of a message: NaN where it is not in it, or is no number; of a time
    its seconds.
    """
    get = value_at(path)
    return lambda message: number(get(message))


def value_at(path: str) -> Callable[[Any], Any]:
    """What takes a field out of a message; None where it is not in it."""
    steps = [(match[1], _index(match[2])) for match in STEP.finditer(path)]

    def get(message: Any) -> Any:
        value = message
        for name, index in steps:
            parent, value = value, _field(value, name)
            if index is not None:
                value = _element(parent, value, index)
        return value

    return get


def _index(text: str | None) -> str | int | None:
    return int(text) if text is not None and text.isdecimal() else text


def number(value: Any) -> float:
    """A field as a number; NaN where it is none."""
    if isinstance(value, float):  # as most are
        return float(value)
    if isinstance(value, str | bytes) or value is None:
        return math.nan
    if (time := nanoseconds(value)) is not None:
        return time / NS
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def nanoseconds(value: Any) -> int | None:
    """A time or a duration; None for anything else."""
    for names in TIMES:
        rest = _field(value, names[1])
        seconds = None if rest is None else _field(value, names[0])
        if seconds is not None:
            return int(seconds) * NS + int(rest)
    return None


def stamp(message: Any) -> int | None:
    """When a message says that it was measured [ns]; None where it does not say."""
    header = _field(message, "header")
    if header is None and (time := nanoseconds(_field(message, "timestamp"))) is not None:
        return time
    return nanoseconds(_field(message if header is None else header, "stamp"))


def leaves(message: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every field that is a number, a time or a text, by its path; arrays of up to MOST elements
    one by one.
    """
    for name in _fields(message):
        value = _field(message, name)
        if isinstance(value, str | bytes) or nanoseconds(value) is not None:
            yield f"{prefix}{name}", value
        elif isinstance(value, Sequence | np.ndarray):
            if len(value) <= MOST:
                yield from _elements(message, f"{prefix}{name}", value)
        elif _fields(value):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def long(message: Any, prefix: str = "") -> Iterator[tuple[str, int]]:
    """The arrays that `leaves` leaves out, with their lengths."""
    for name in _fields(message):
        value = _field(message, name)
        if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str):
            if len(value) > MOST:
                yield f"{prefix}{name}", len(value)
        elif _fields(value):
            yield from long(value, f"{prefix}{name}.")


def _elements(message: Any, path: str, values: Any) -> Iterator[tuple[str, Any]]:
    names = _names(message)
    alike = len(set(names)) == len(values) and all(_is_plain(name) for name in names)
    for at, value in enumerate(values):
        key = names[at] if alike and not isinstance(value, str) else at
        if _fields(value) and nanoseconds(value) is None:
            yield from leaves(value, f"{path}[{key}].")
        else:
            yield f"{path}[{key}]", value


def _is_plain(name: str) -> bool:
    """Whether a name may stand as an index."""
    return bool(name) and not name.isdecimal() and not re.search(r"[\[\]]", name)


def _element(parent: Any, values: Any, index: str | int) -> Any:
    """An element by its number or by its name; None where there is none."""
    if not isinstance(values, np.ndarray | list | tuple):
        return None
    if isinstance(index, int):
        return values[index] if index < len(values) else None

    for field in NAMES:
        names = _field(parent, field)
        if isinstance(names, list) and index in names:
            at = names.index(index)
            return values[at] if at < len(values) else None
    return next((each for each in values if _field(each, "name") == index), None)


def _names(message: Any) -> list[str]:
    """The names that a message has for the elements of its arrays; none as a rule."""
    for field in NAMES:
        names = _field(message, field)
        if isinstance(names, list) and names and all(isinstance(name, str) for name in names):
            return names
    return []


def _field(message: Any, name: str) -> Any:
    """A field of a message; None where it has none such."""
    if type(message) is dict:  # of JSON
        return message.get(name)
    return getattr(message, name, None)


def _fields(value: Any) -> Sequence[str]:
    """The names of a message's fields; none where it is no message."""
    if isinstance(value, dict):
        return [str(name) for name in value]
    fields = dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()
    return [field.name for field in fields]
