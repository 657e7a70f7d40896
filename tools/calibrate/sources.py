"""What a sensor read while known values were set: from a recording, or from the live sensors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from gritd.estimator.config import units
from gritd.estimator.config.settings import Uncertain
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.calibrate import creep, spikes
from gritd.tools.calibrate.line import Point
from gritd.tools.calibrate.plateaus import Plateau, between, plateaus
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.cli.files import recording

STEP = re.compile(r"\s*([0-9.]+)\s*-\s*([0-9.]+)\s*=\s*(.+)")


@dataclass(frozen=True)
class Signal:
    """One field of one raw topic; key of the channel and name of the field."""

    channel: str
    field: str
    unit: str  # raw


class CalibrationSource(Protocol):
    """Where readings come from."""

    def points(self, signal: Signal, known: Sequence[Uncertain]) -> list[Point]:
        """What was read at each known value. Raises CommandError."""


@dataclass(frozen=True)
class RecordedSteps:
    """A recording in which the values were set one after the other.

    steps: (begin, end) [s] of each, from the first reading of the sensor; where there are none, the
        stretches in which it stands still are taken.
    """

    path: Path
    steps: tuple[tuple[float, float], ...] = ()

    def points(self, signal: Signal, known: Sequence[Uncertain]) -> list[Point]:
        seconds, values, spiky = series(recording(self.path), signal)
        stretches = self._chosen(seconds, values) if self.steps else plateaus(seconds, values)

        if len(stretches) != len(known):
            where = ", ".join(f"{p.begin:.1f}-{p.end:.1f} s" for p in stretches[:12]) or "none"
            raise CommandError(
                f"{self.path}: {signal.channel}: found {len(stretches)} stretches at rest "
                f"({where}); expected {len(known)}, one for each known value; "
                "--step BEGIN-END=VALUE states them",
                DAMAGED,
            )

        return points_of(stretches, known, signal, spiky, f"{self.path}: ")

    def _chosen(self, seconds: Array, values: Array) -> list[Plateau]:
        stretches = []

        for begin, end in self.steps:
            one = between(seconds, values, begin, end)
            if one is None:
                raise CommandError(
                    f"{self.path}: found fewer than ten readings from {begin:g} to {end:g} s; "
                    f"expected times from 0 to {seconds[-1]:.1f} s",
                    USAGE,
                )

            stretches.append(one)
        return stretches


def points_of(
    stretches: Sequence[Plateau],
    known: Sequence[Uncertain],
    signal: Signal,
    spiky: str,
    where: str = "",
) -> list[Point]:
    """What was read while known values stood. Raises CommandError where the readings creep."""
    notes = tuple(filter(None, (spiky, creep.checked(stretches, signal.channel, where))))
    return [Point(p.mean, value, notes) for p, value in zip(stretches, known, strict=True)]


def series(recorded: Recording, signal: Signal) -> tuple[Array, Array, str]:
    """Seconds from the first reading and raw values, both (n,), without single spikes, and a line
    about these. Raises CommandError.
    """
    rows = recorded.arrays(f"/raw/{signal.channel}")
    if rows.size < 10:
        raise CommandError(
            f"{recorded.path}: found {rows.size or 'no'} readings of {signal.channel}; "
            "expected some seconds",
            DAMAGED,
        )
    rows = rows[np.argsort(rows["stamp"], kind="stable")]
    seconds, values = (rows["stamp"] - rows["stamp"][0]) * 1e-9, rows[signal.field].astype(float)
    found = spikes.spikes(values)
    line = spikes.note(found, signal.channel, f"{recorded.path}: ")
    return seconds[~found], values[~found], line


def start_of(recorded: Recording, signal: Signal) -> float:
    """Of a channel's first reading [s since 1970]."""
    return float(recorded.arrays(f"/raw/{signal.channel}")["stamp"].min()) * 1e-9


def known_values(text: str, unit: str, sigma: float = 0.0) -> list[Uncertain]:
    """`0 mm, 10 mm, 20 mm`, or `0, 10, 20 mm`: the last unit is that of all. Raises
    CommandError.
    """
    pieces = [piece.strip() for piece in text.split(",")]
    last = re.sub(units.NUMBER, "", pieces[-1], count=1).strip()
    return [
        Uncertain(known_value(p if _has_unit(p) else f"{p} {last}", unit), sigma) for p in pieces
    ]


def _has_unit(text: str) -> bool:
    return not units.NUMBER.fullmatch(text)


def known_value(text: str, unit: str) -> float:
    """One quantity in SI. Raises CommandError."""
    try:
        return units.parse(text.strip(), unit)
    except units.UnitError as error:
        raise CommandError(
            f"found {text.strip()[:40]!r} ({error}); expected a value such as {_example(unit)}",
            USAGE,
        ) from None


def _example(unit: str) -> str:
    return {"m": "10 mm", "A": "1.5 A", "N": "50 N", "N*m": "2 N*m", "turn": "1 turn"}.get(
        unit, f"1 {unit}"
    )


def steps(
    texts: Sequence[str], unit: str, sigma: float
) -> tuple[list[tuple[float, float]], list[Uncertain]]:
    """Times and values of `2-5=10 mm`. Raises CommandError."""
    times, values = [], []

    for text in texts:
        match = STEP.fullmatch(text)
        if match is None:
            raise CommandError(f"--step {text}: expected BEGIN-END=VALUE, such as 2-5=10 mm", USAGE)
        times.append((float(match[1]), float(match[2])))
        values.append(Uncertain(known_value(match[3], unit), sigma))

    return times, values
