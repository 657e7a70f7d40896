"""What a testbed is to do: segments of load, slip and speed, joined by ramps; from YAML to a
motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gritd.estimator.config.configuration import read_text
from gritd.estimator.config.kinds import Kind, NumberWithUnit
from gritd.estimator.config.schema import Key, Section
from gritd.estimator.config.yamltree import Node, YamlSequence, compose, describe
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array

LOCKED = -0.95  # [-] a wheel more locked than this is not driven by its motor any more


@dataclass(frozen=True)
class Segment:
    """A stretch of steady driving. Rim speed 0 is standstill, load 0 a lifted wheel, slip 1 a
    stall.
    """

    duration: float  # [s]
    load: float  # weights on the axle [N]
    slip: float  # [-]
    speed: float  # rω [m/s]


@dataclass(frozen=True)
class Schedule:
    segments: tuple[Segment, ...]
    ramp: float  # [s] at the end of each segment, towards the next

    @property
    def duration(self) -> float:
        return sum(segment.duration for segment in self.segments)


@dataclass(frozen=True)
class Listed:
    """A list of values of one kind, at least one."""

    kind: Kind
    expected: str = "a list"

    def read(self, node: Node) -> tuple[tuple[object, ...], Node]:
        if not isinstance(node, YamlSequence) or not node.items:
            raise node.place.error(describe(node), self.expected)
        return tuple(self.kind.read(item)[0] for item in node.items), node


SEGMENT = {
    "duration": Key(NumberWithUnit("s", above=0, high=86400), "how long"),
    "load": Key(NumberWithUnit("N", low=0, high=1e5), "weights on the axle"),
    "slip": Key(NumberWithUnit("", low=LOCKED, high=1), "slip"),
    "speed": Key(NumberWithUnit("m/s", low=-10, high=10), "rim speed, negative backward"),
}
SCHEDULE = {
    "ramp": Key(
        NumberWithUnit("s", low=0, high=3600),
        "time from one segment's conditions to the next",
        "500 ms",
    ),
    "segments": Key(
        Listed(Section(SEGMENT, Segment), "a list of segments"), "what to do, in order"
    ),
}


def read(path: Path) -> Schedule:
    """A schedule file. Raises ConfigError in one line."""
    text = read_text(path, "a schedule file")
    schedule: Schedule = Section(SCHEDULE, lambda ramp, segments: Schedule(segments, ramp)).read(
        compose(text, str(path))
    )[0]
    return schedule


def motion_of(
    schedule: Schedule,
    radius: float,
    rate: float,
    pass_number: float = 1.0,
    start_position: float = 0.0,
) -> Motion:
    """The motion a perfect controller makes of a schedule, as its encoders tell it; `rate` samples
    a second.
    """
    time = np.arange(max(round(schedule.duration * rate), 2)) / rate
    load, slip, speed = (_ramped(schedule, time, name) for name in ("load", "slip", "speed"))
    travel = np.where(slip >= 0.0, speed * (1.0 - slip), speed / (1.0 + np.minimum(slip, 0.0)))

    return Motion(
        time=time,
        wheel_angle=_summed(speed / radius, rate),
        wheel_speed=speed / radius,
        carriage_position=_summed(travel, rate),
        carriage_speed=travel,
        load=load,
        pass_number=pass_number,
        start_position=start_position,
    )


def _ramped(schedule: Schedule, time: Array, name: str) -> Array:
    """One quantity of the schedule over time: steady, then a ramp to the next segment; ramps fit
    their segments.
    """
    levels = [getattr(segment, name) for segment in schedule.segments]
    knots = np.array(list(_knots(schedule)))
    values: Array = np.interp(time, knots, np.repeat(levels, 2))
    return values


def _knots(schedule: Schedule) -> Iterable[float]:
    start = 0.0
    for segment in schedule.segments:
        yield start
        start += segment.duration
        yield start - min(schedule.ramp, 0.5 * segment.duration)


def _summed(rate_of_change: Array, rate: float) -> Array:
    """Integral by trapezoids, 0 at the start."""
    steps = 0.5 * (rate_of_change[1:] + rate_of_change[:-1]) / rate
    return np.concatenate(([0.0], np.cumsum(steps)))
