"""Units that are taken for each other, and how a mistake is to be put right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose, pi

# channel of a map -> units of what it holds, in SI
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
ANGLES = {"rad": 1.0, "deg": pi / 180.0, "turn": 2.0 * pi}
TURNING = {"rad/s": 1.0, "rpm": pi / 30.0, "deg/s": pi / 180.0}
TORQUES = {"N*m": 1.0, "N*cm": 1e-2, "N*mm": 1e-3}
CURRENTS = {"A": 1.0, "mA": 1e-3}
FORCES = {"N": 1.0, "kN": 1e3, "kg": 9.80665, "lbf": 4.4482216}
UNITS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "wheel_angle": ANGLES,
    "wheel_speed": TURNING,
    "rim_speed": SPEEDS,
    "carriage_position": LENGTHS,
    "carriage_speed": SPEEDS,
    "sinkage": LENGTHS,
    "load": FORCES,
    "drawbar_pull": FORCES,
    "torque": TORQUES,
    "motor_torque": TORQUES,
    "current": CURRENTS,
}
# channel of a recording, whose raw numbers have no unit -> channels of a map that it may come from
RECORDED = {
    "wheel": ("wheel_speed", "wheel_angle"),
    "carriage": ("carriage_position",),
    "sinkage": ("sinkage",),
    "load": ("load",),
    "pull": ("drawbar_pull",),
    "torque": ("torque", "current"),
}


@dataclass(frozen=True)
class Remedy:
    """factor: what the quantity is to be multiplied by; words: what that is the mark of."""

    factor: float
    words: str


@dataclass(frozen=True)
class QuantitySource:
    """Where a quantity comes from: a column with a unit, or a channel of a recording."""

    name: str  # as the user knows it
    channel: str = ""  # of the map; empty for a channel of a recording
    unit: str = ""
    per_unit: float = 1.0

    @property
    def speed(self) -> bool:
        """Whether the quantity was recorded as a speed."""
        return self.channel.endswith("speed")


Sources = Mapping[
    str, QuantitySource
]  # by quantity: time, wheel, carriage, sinkage, load, torque, pull
OF_A_RECORDING: Sources = {
    "wheel": QuantitySource("wheel_encoder"),
    "carriage": QuantitySource("carriage_encoder"),
    "sinkage": QuantitySource("sinkage_pot"),
    "load": QuantitySource("load of the wrench"),
    "torque": QuantitySource("torque"),
    "pull": QuantitySource("drawbar_pull of the wrench"),
}


def remedies(quantity: str, sources: Sources) -> list[Remedy]:
    """Other units that a quantity may be in. A clock of a recording has none: a daemon's own."""
    source = sources.get(quantity)
    if source is None:
        return []
    if source.channel:
        return _of_column(quantity, source) if source.unit else []
    return [
        remedy
        for channel in RECORDED.get(quantity, ())
        for taken, per in UNITS[channel].items()
        for remedy in _of_scale(source.name, taken, per, UNITS[channel])
    ]


def _of_column(quantity: str, source: QuantitySource) -> list[Remedy]:
    """Units that a column may have in the place of that of the map."""
    called = f"{quantity} ({source.name})" if source.name != quantity else quantity
    return [
        Remedy(factor / source.per_unit, f"{called} looks like {unit}, not {source.unit}")
        for unit, factor in UNITS.get(source.channel, {}).items()
        if not isclose(factor, source.per_unit, rel_tol=1e-3)
    ]


def _of_scale(name: str, taken: str, per: float, units: Mapping[str, float]) -> list[Remedy]:
    return [
        Remedy(factor / per, f"{name} has {unit} taken for {taken}")
        for unit, factor in units.items()
        if unit != taken
    ]


def turned(quantity: str, sources: Sources) -> str:
    """How the sign of a quantity is turned."""
    source = sources.get(quantity, QuantitySource(quantity))
    if source.channel:
        return f"factor: -1 for {source.name} turns it"
    return f"the scale of {source.name} turns it"
