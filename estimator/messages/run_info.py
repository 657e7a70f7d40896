"""What one run was: which bed, which load, which pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

MOST = 1e6  # of a load [N], a place [m], a part
MOST_PASSES = 1000
MOST_LOST = 2**63
LONGEST = 40  # characters of a number

Kind = type[int] | type[float]


@dataclass(frozen=True)
class RunInfo:
    """What one run was; a recording keeps it in its metadata.

    A recording has no gaps. Where messages had to be dropped (a full disk) a new file begins:
    `part` counts these, and `lost_before` says how many messages are missing between the part
    before and this one.
    """

    name: str = ""
    nominal_load: float | None = None  # [N]
    pass_number: int = 1  # how many times the wheel has gone over this soil, this run included
    start_position: float = 0.0  # [m] of the carriage on the bed
    notes: str = ""
    part: int = 0
    lost_before: int = 0
    bed: str = ""  # whose earlier runs the estimate began with
    operator: str = ""  # who ran it
    # a table's means, with scatter that an importer drew: no course of time, place or wheel angle
    steady_states: bool = False

    def entries(self) -> dict[str, str]:
        every = asdict(self)
        if not self.steady_states:
            del every["steady_states"]
        return {key: "" if value is None else str(value) for key, value in every.items()}

    @classmethod
    def from_entries(cls, entries: Mapping[str, str]) -> tuple[RunInfo, list[str]]:
        """The inverse of `entries`, and a line for each value that cannot be: the default stands
        for it. Unknown keys are ignored.
        """
        wrong: list[str] = []

        def number(key: str, kind: Kind, default: Any, low: float, high: float) -> Any:
            text = entries.get(key, "")
            value = _number(kind, text)
            if value is not None and low <= value <= high:
                return value
            if not text:
                return default
            wrong.append(f"{key}: found {text[:40]!r}; expected a number from {low:g} to {high:g}")
            return default

        run = cls(
            name=entries.get("name", ""),
            nominal_load=number("nominal_load", float, None, 0.0, MOST),
            pass_number=number("pass_number", int, 1, 1, MOST_PASSES),
            start_position=number("start_position", float, 0.0, -MOST, MOST),
            notes=entries.get("notes", ""),
            part=number("part", int, 0, 0, MOST),
            lost_before=number("lost_before", int, 0, 0, MOST_LOST),
            bed=entries.get("bed", ""),
            operator=entries.get("operator", ""),
            steady_states=entries.get("steady_states", "") == "True",
        )
        return run, wrong


def _number(kind: Kind, text: str) -> float | None:
    """None where the text is no number."""
    try:
        return kind(text) if len(text) <= LONGEST else None
    except ValueError:
        return None
