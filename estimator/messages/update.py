"""What one filter update says: the fields of /update, at the filter's rate.

Innovations of /tick are zero in all ticks between two updates. /update has them alone, with what
belongs to them, so that a plot of them is a curve.
"""

from __future__ import annotations

from math import nan, sqrt
from typing import Annotated, NamedTuple

from gritd.estimator.messages.tick import (
    TICK_NAMES,
    Aid,
    Bits,
    Byte,
    Count,
    LongCount,
    Real,
    SoilEstimate,
    TickRow,
    Time,
    fields_of,
    names_of,
)


class UpdateHead(NamedTuple):
    """When the update was, and how it stands with the filter."""

    stamp: Annotated[Time, "time of the tick"]
    evaluated: Annotated[Time, "the instant that the window describes: its centre"]
    status: Annotated[Byte, "Status"]
    flags: Annotated[Bits, "Flag bits"]
    updates: Annotated[LongCount, "filter updates applied since the start, this one included"]
    resets: Annotated[Count, "covariance resets since the start"]
    separability: Annotated[
        Real, "posterior over prior σ in the weakest direction of (c, tan φ) [-]"
    ]
    consistency: Annotated[
        Real, "mean normalised innovation squared per measurement over 2 s, 1 when honest [-]"
    ]


class Normalised(NamedTuple):
    """Innovations over their standard deviation: inside ±2 in 95 % where σ is honest."""

    torque_sigmas: Annotated[Real, "innovation of the torque over √S [-]"]
    drawbar_pull_sigmas: Annotated[Real, "of the drawbar pull, NaN where it is not measured [-]"]


class UpdateMessage(NamedTuple):
    """One update: its blocks in the order of the recording."""

    head: UpdateHead
    normalised: Normalised
    torque: Annotated[Aid, "N·m"]
    drawbar_pull: Annotated[Aid, "N"]
    soil: SoilEstimate


UPDATE_NAMES = names_of(UpdateMessage)
UPDATE_FIELDS = fields_of(UpdateMessage)

_PLACE = {name: place for place, name in enumerate(TICK_NAMES)}
_COPIED = [_PLACE[name] for name in UPDATE_NAMES if name not in Normalised._fields]
_FIRST = UPDATE_NAMES.index(Normalised._fields[0])
_TORQUE = _PLACE["torque_innovation"], _PLACE["torque_s"]
_PULL = _PLACE["drawbar_pull_innovation"], _PLACE["drawbar_pull_s"]


def update_of(tick: TickRow) -> TickRow | None:
    """The update that a tick made, in the order of UPDATE_FIELDS; None where it made none."""
    if not tick[_TORQUE[1]] and not tick[_PULL[1]]:
        return None
    copied = [tick[place] for place in _COPIED]
    return (*copied[:_FIRST], _sigmas(tick, *_TORQUE), _sigmas(tick, *_PULL), *copied[_FIRST:])


def _sigmas(tick: TickRow, innovation: int, variance: int) -> float:
    return tick[innovation] / sqrt(tick[variance]) if tick[variance] > 0.0 else nan
