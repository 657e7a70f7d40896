"""A report of the daemon in words: what is shown of a tick, and what must not be overlooked."""

from __future__ import annotations

import time
from collections.abc import Mapping
from math import degrees
from typing import Any, NamedTuple


class ShownValue(NamedTuple):
    """A value of a tick as people read it."""

    label: str
    value: str  # field of /tick
    sigma: str  # field of its standard deviation
    factor: float  # from SI to the unit
    unit: str
    decimals: int


SHOWN = (
    ShownValue("c", "cohesion", "cohesion_sigma", 1.0, "Pa", 0),
    ShownValue("tan φ", "tan_phi", "tan_phi_sigma", 1.0, "", 4),
    ShownValue("k", "shear_modulus", "shear_modulus_sigma", 1e3, "mm", 1),
    ShownValue("slip", "slip", "slip_sigma", 100.0, "%", 1),
    ShownValue("sinkage", "sinkage", "sinkage_sigma", 1e3, "mm", 2),
    ShownValue("θ₁", "theta_1", "theta_1_sigma", degrees(1.0), "°", 2),
    ShownValue("load", "load", "load_sigma", 1.0, "N", 2),
    ShownValue("torque", "torque", "torque_sigma", 1.0, "N·m", 3),
    ShownValue("pull", "drawbar_pull", "drawbar_pull_sigma", 1.0, "N", 2),
)


def disagreement(disagreeing: Mapping[str, Any]) -> str:
    """Channel, time and size of a disagreement between model and measurement."""
    since = time.strftime("%H:%M:%S", time.gmtime(disagreeing["since"]))
    return (
        f"disagrees with {disagreeing['channel'].replace('_', ' ')} since {since} UTC, "
        f"{disagreeing['sigmas']:.1f} σ off"
    )


def age(seconds: float) -> str:
    """A time that has passed."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
