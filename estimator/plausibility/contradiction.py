"""What cannot be, in words, and what several checks need."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.plausibility.driven import RunWindows
from gritd.estimator.terramechanics.soil import Array, Wheel

LEAST = 5  # windows that tell of a run
MOST, FEW = 0.9, 0.05  # shares of the windows
DEEPEST = 1.4  # [rad] an entry angle, 80°


class Contradiction(NamedTuple):
    """kind: the same of all runs in which the same is amiss; alone: whether one run is enough, else
    all of a campaign have to show it.
    """

    kind: str
    text: str
    alone: bool = True


def contradiction(kind: str, fact: str, likely: list[str]) -> Contradiction:
    """A fact, with what would put it right."""
    remedy = " or ".join(likely[:3])
    return Contradiction(f"{kind}: {remedy}", f"{fact}: {remedy}" if likely else fact)


def load_of(course: RunWindows, settings: Settings) -> float:
    """Usual size of the load [N] while driving."""
    load = course.load[course.driving & np.isfinite(course.load)]
    return abs(float(np.median(load))) if load.size else settings.load.nominal.value


def datum(settings: Settings) -> float:
    """How far the zero of the sinkage may be off [m]."""
    channel = settings.channels.get("sinkage_pot")
    return 4.0 * channel.calibration.offset.sigma if channel else 0.0


def entry_angle(wheel: Wheel, sinkage: Array) -> Array:
    """θ₁ (n,) [rad], at most 80°."""
    angle: Array = np.arccos(np.clip(1.0 - sinkage / wheel.radius, np.cos(DEEPEST), 1.0))
    return angle
