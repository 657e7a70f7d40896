"""What one run was: which bed, which load, which pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


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

    def entries(self) -> dict[str, str]:
        return {key: "" if value is None else str(value) for key, value in asdict(self).items()}

    @classmethod
    def from_entries(cls, entries: Mapping[str, str]) -> RunInfo:
        """The inverse of `entries`; unknown keys are ignored. Raises ValueError naming a key that
        cannot be read.
        """
        return cls(
            name=entries.get("name", ""),
            nominal_load=_number(entries, "nominal_load", float),
            pass_number=_number(entries, "pass_number", int, 1),
            start_position=_number(entries, "start_position", float, 0.0),
            notes=entries.get("notes", ""),
            part=_number(entries, "part", int, 0),
            lost_before=_number(entries, "lost_before", int, 0),
        )


def _number(
    entries: Mapping[str, str], key: str, kind: type[int] | type[float], default: Any = None
) -> Any:
    text = entries.get(key, "")
    try:
        return kind(text) if text else default
    except ValueError:
        raise ValueError(f"{key}: {text!r} is not a number") from None
