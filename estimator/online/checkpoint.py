"""The state between two ticks as text, and back, to the bit: what a part of a recording begins
with.

JSON holds every float exactly (Python writes the shortest digits that read back the same). Named
tuples and dataclasses stand as {"Name": [fields]}; the names that may occur are those a `State` is
declared to be made of, so a text from outside builds nothing else.
"""

from __future__ import annotations

import json
import typing
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import IntFlag
from functools import cache
from types import UnionType
from typing import Any

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.online.pipeline import State
from gritd.estimator.online.sound import unsound
from gritd.estimator.wheel.sync import Sync
from gritd.estimator.wheel.windows import Counters, MeanWindow, Sample, SlopeWindow

_FIELDS = "__dataclass_fields__"
DEEPEST = 40  # levels of a state; a text of more is none
LARGEST = 10**60  # of whole numbers: sums of squared nanoseconds and counts are exact
_SHARED = "counters"  # of a SlopeWindow: the Sync's own


def encode(state: State) -> str:
    """The text of a state."""
    rest = tuple([getattr(state, field.name) for field in fields(state) if field.name != "sync"])
    return json.dumps(
        {"sync": _plain(state.sync.memory()), "rest": _plain(rest)}, separators=(",", ":")
    )


def decode(text: str, settings: Settings) -> State:
    """The state a text holds, for a pipeline of these settings (`Pipeline.settings`).

    Raises ValueError, one line, where the text is no state or one of other settings.
    """
    try:
        parts = json.loads(text)
        sync = Sync(settings)
        sync.remember(_object(parts["sync"]))

        rest = _object(parts["rest"])
        _check(State, [name for name in _field_names(State) if name != "sync"], rest)
        return State(sync, *rest)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(
            f"not a state of this configuration: {type(error).__name__}: {error!s:.100}"
        ) from None


def _plain(value: Any) -> Any:
    """JSON's own types from a value of the state."""
    if isinstance(value, IntFlag):
        return {type(value).__name__: [int(value)]}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, bytes):
        return {"bytes": value.hex()}
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        return [_plain(item) for item in value]
    if isinstance(value, list | deque):
        return {type(value).__name__: [_plain(item) for item in value]}
    if isinstance(value, Mapping):
        return {"dict": {key: _plain(item) for key, item in value.items()}}
    if type(value).__name__ not in _kinds():
        raise TypeError(f"a state holds no {type(value).__name__}")

    return {type(value).__name__: [_plain(getattr(value, name)) for name in _field_names(value)]}


def _object(plain: Any, depth: int = 0) -> Any:
    """The inverse of `_plain`."""
    if depth > DEEPEST:
        raise ValueError("nested too deeply")
    if isinstance(plain, list):
        return tuple([_object(item, depth + 1) for item in plain])
    if not isinstance(plain, dict):
        return plain

    ((name, content),) = plain.items()
    if name == "bytes":
        return bytes.fromhex(content)
    if name == "dict":
        return {key: _object(item, depth + 1) for key, item in content.items()}

    values = [_object(item, depth + 1) for item in content]
    return _kinds()[name](values) if name in ("list", "deque") else _build(_kinds()[name], values)


def _build(kind: Any, values: list[Any]) -> Any:
    """Raises TypeError, ValueError where the values are not what it is declared to hold."""
    if issubclass(kind, IntFlag):
        return kind(*values)
    names = _field_names(kind)
    _check(kind, names, values)
    if kind is Estimate and (wrong := unsound(Estimate(*values))):
        raise ValueError(f"an estimate that is {wrong}")
    if not hasattr(kind, _FIELDS):
        return kind(*values)
    return kind(**dict(zip(names, values, strict=True)))


def _check(kind: Any, names: list[str], values: Sequence[Any]) -> None:
    """Raises TypeError where a value is not what its field is declared to hold."""
    hints = typing.get_type_hints(kind)
    for name, value in zip(names, values, strict=False):
        if not _fits(value, hints[name]):
            raise TypeError(f"{kind.__name__}.{name}: {value!r:.40} is none of its values")


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is what the hint declares; a number is also one to calculate with."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)

    if origin in (typing.Union, UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is tuple and parts[-1:] != (...,):
        alike = isinstance(value, tuple) and len(value) == len(parts)
        return alike and all(map(_fits, value, parts))
    if origin in (tuple, list, deque):
        return isinstance(value, origin) and all(_fits(item, parts[0]) for item in value)
    if origin is Mapping:
        return isinstance(value, dict) and all(_fits(item, parts[1]) for item in value.values())
    if hint is float or hint is int:
        kinds = (int, float) if hint is float else int
        small = not isinstance(value, int) or abs(value) <= LARGEST
        return isinstance(value, kinds) and not isinstance(value, bool) and small
    return value is None if hint is type(None) else isinstance(value, hint)


def _field_names(kind: Any) -> list[str]:
    if is_dataclass(kind):
        return [field.name for field in fields(kind) if field.name != _SHARED]
    return list(kind._fields) if hasattr(kind, "_fields") else ["value"]


@cache
def _kinds() -> dict[str, Callable[..., Any]]:
    """Name → class of everything a State is made of."""
    roots = (State, Sample, MeanWindow, SlopeWindow, Counters)
    made = {kind.__name__: kind for root in roots for kind in _made_of(root, set())}
    return {**made, "list": list, "deque": deque}


def _made_of(kind: Any, seen: set[Any]) -> Iterator[type]:
    """The named tuples, dataclasses and flags that the type hints of `kind` lead to, itself
    included.
    """
    if typing.get_origin(kind) is not None or isinstance(kind, UnionType):
        for part in typing.get_args(kind):
            yield from _made_of(part, seen)
    elif isinstance(kind, type) and kind not in seen:
        seen.add(kind)
        if issubclass(kind, IntFlag):
            yield kind
        elif (is_dataclass(kind) or hasattr(kind, "_fields")) and kind is not Sync:
            yield kind
            for hint in typing.get_type_hints(kind).values():
                yield from _made_of(hint, seen)
