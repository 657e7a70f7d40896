"""Key `discrepancy`: what the equations miss on this rig, as `gritd diagnose --apply` writes it.

The format is that of estimator/model/learnt.py. Numbers without a unit are in units of the lengths
over which δ changes (points), of its size (mean, spread, rest), or correlations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gritd.estimator.config.kinds import Choice, Interval, NumberWithUnit
from gritd.estimator.config.schema import ABSENT, Impossible, Key, Section
from gritd.estimator.config.yamltree import Node, YamlSequence, describe
from gritd.estimator.model.correction import Correction
from gritd.estimator.model.discrepancy import CONDITIONS
from gritd.estimator.model.learnt import (
    CHANNELS,
    ChannelForm,
    Domain,
    LearntForm,
    LearntSoil,
    Vector,
)

MOST_POINTS, MOST_DIRECTIONS = 64, 24
TRAVELS = ("forward", "backward", "both")


@dataclass(frozen=True)
class NumberList:
    """A list of plain numbers."""

    number: NumberWithUnit
    least: int
    most: int
    of: str = "numbers"

    @property
    def expected(self) -> str:
        count = f"{self.least}" if self.least == self.most else f"{self.least} to {self.most}"
        return f"a list of {count} {self.of}"

    def read(self, node: Node) -> tuple[Vector, Node]:
        if not isinstance(node, YamlSequence) or not self.least <= len(node.items) <= self.most:
            raise node.place.error(describe(node), self.expected)
        return tuple([self.number.read(item)[0] for item in node.items]), node


@dataclass(frozen=True)
class NumberRows:
    """A list of lists of plain numbers."""

    row: NumberList
    least: int
    most: int
    of: str

    @property
    def expected(self) -> str:
        return f"a list of {self.least} to {self.most} {self.of}, each {self.row.expected}"

    def read(self, node: Node) -> tuple[tuple[Vector, ...], Node]:
        if not isinstance(node, YamlSequence) or not self.least <= len(node.items) <= self.most:
            raise node.place.error(describe(node), self.expected)
        return tuple([self.row.read(item)[0] for item in node.items]), node


NUMBER = NumberWithUnit("", low=-1e3, high=1e3)
CORRELATION = NumberWithUnit("", low=-1, high=1)
ALONG_POINTS = NumberList(NUMBER, 1, MOST_POINTS, "numbers, one a point")
ALONG_DIRECTIONS = NumberList(CORRELATION, 0, MOST_DIRECTIONS, "correlations, one a direction")

DOMAIN = {
    "slip": Key(Interval(NumberWithUnit("", low=-1, high=1)), "slip"),
    "load": Key(Interval(NumberWithUnit("N", above=0)), "load"),
    "speed": Key(Interval(NumberWithUnit("m/s", above=0)), "speed of the rim"),
    "travel": Key(Choice(TRAVELS), "which way the wheel went", "forward"),
}


def _channel(unit: str) -> Section:
    keys = {
        "size": Key(NumberWithUnit(unit, above=0), "size s at the usual load: the prior's σ"),
        "mean": Key(ALONG_POINTS, "mean μ, in sizes"),
        "spread": Key(
            NumberRows(ALONG_POINTS, 0, MOST_DIRECTIONS, "directions"),
            "directions in which it is still uncertain, one σ each, in sizes",
            "[]",
        ),
        "rest": Key(
            NumberWithUnit("", low=0, high=1),
            "σ of what the directions do not hold, in sizes",
            "0.0",
        ),
    }

    return Section(keys, ChannelForm)


SOIL = {
    "cohesion": Key(NumberWithUnit("Pa", low=0), "c that was written with it"),
    "tan_phi": Key(NumberWithUnit("", above=0), "tan φ that was written with it"),
    "shear_modulus": Key(NumberWithUnit("m", above=0), "k that was written with it"),
    "with_cohesion": Key(ALONG_DIRECTIONS, "correlation of c with each direction"),
    "with_tan_phi": Key(ALONG_DIRECTIONS, "correlation of tan φ with each direction"),
    "with_shear_modulus": Key(ALONG_DIRECTIONS, "correlation of k with each direction"),
    "among": Key(
        NumberList(CORRELATION, 3, 3, "correlations"),
        "correlation of c with tan φ, of c with k, of tan φ with k",
        "[0.0, 0.0, 0.0]",
    ),
}

POINT = NumberList(NUMBER, len(CONDITIONS), len(CONDITIONS), f"numbers ({', '.join(CONDITIONS)})")

DISCREPANCY = {
    "load": Key(NumberWithUnit("N", above=0), "usual load, from which loads count"),
    "speed": Key(NumberWithUnit("m/s", above=0), "usual speed of the rim"),
    "domain": Key(
        Section(DOMAIN, Domain), "where it was learnt; outside it goes back to its prior"
    ),
    "points": Key(
        NumberRows(POINT, 1, MOST_POINTS, "points"),
        "inducing points: conditions, in the lengths over which it changes",
    ),
    "torque": Key(_channel("N*m"), "of the torque at the axle", ABSENT),
    "drawbar_pull": Key(_channel("N"), "of the drawbar pull", ABSENT),
    "sinkage": Key(_channel("m"), "of the sinkage", ABSENT),
    "soil": Key(
        Section(SOIL, LearntSoil),
        "the soil it was learnt with, and its correlation with it",
        ABSENT,
    ),
}


def discrepancy() -> Section:
    """The section; reading it gives a LearntForm."""
    return Section(DISCREPANCY, _form)


def _form(**values: Any) -> LearntForm:
    """Raises Impossible where no channel has any, lists do not fit together, or points coincide."""
    form = LearntForm(**values)
    if not any(form.channels):
        raise Impossible("points", f"one at least of {', '.join(CHANNELS)} with them")

    for name, channel in zip(CHANNELS, form.channels, strict=True):
        if channel is not None:
            _check_channel(name, channel, form)
    if form.soil is not None:
        form = replace(form, soil=_checked(form.soil, form.directions))

    try:
        Correction(form)
    except np.linalg.LinAlgError:
        raise Impossible("points", "points that differ") from None
    return form


def _check_channel(name: str, channel: ChannelForm, form: LearntForm) -> None:
    points = len(form.points)
    if len(channel.mean) != points:
        raise Impossible(f"{name}.mean", f"{points} numbers, one a point")
    if len(channel.spread) != form.directions:
        raise Impossible(f"{name}.spread", f"{form.directions} directions, the same for all")
    for row in channel.spread:
        if len(row) != points:
            raise Impossible(
                f"{name}.spread", f"{points} numbers a direction, one a point", f"{len(row)}"
            )


def _checked(soil: LearntSoil, directions: int) -> LearntSoil:
    """Raises Impossible where correlations are not one a direction, or cannot hold together."""
    for name in ("with_cohesion", "with_tan_phi", "with_shear_modulus"):
        if len(getattr(soil, name)) != directions:
            raise Impossible(f"soil.{name}", f"{directions} correlations, one a direction")

    c_tan, c_k, tan_k = soil.among
    among = np.array([[1.0, c_tan, c_k], [c_tan, 1.0, tan_k], [c_k, tan_k, 1.0]])
    beside = np.array(soil.correlations).reshape(3, directions)
    if float(np.linalg.eigvalsh(among - beside @ beside.T)[0]) <= 0.0:
        raise Impossible(
            "soil.among",
            "correlations that hold together: less their squares, a variance is left",
            "correlations of which a combination exceeds 1",
        )
    return soil
