"""The channels in the configuration file: units, calibration, limits, timing; the wrench."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

from gritd.estimator.config.devices import NAME
from gritd.estimator.config.kinds import UNLIMITED, Integer, Interval, NumberWithUnit, Text
from gritd.estimator.config.schema import ABSENT, NEEDED, Impossible, Key, Section, uncertain
from gritd.estimator.config.settings import (
    Calibration,
    Channel,
    Uncertain,
    Wrench,
)
from gritd.estimator.config.yamltree import Node, Scalar, describe
from gritd.estimator.messages.readings import CHANNELS, ENCODERS, MOTION

# channel -> raw unit, physical unit, unit of raw differences
UNITS = {
    "wheel_encoder": ("count", "rad", "count"),
    "carriage_encoder": ("count", "rad", "count"),
    "sinkage_pot": ("V", "m", "V"),
    "motor_shunt": ("V", "A", "V"),
    "motor_temperature": ("degC", "K", "K"),
}


CHANNEL_DOCS = {
    "wheel_encoder": "counts of the wheel axle; physical: angle of the wheel",
    "carriage_encoder": "counts of the carriage pulley; physical: angle of the pulley",
    "sinkage_pot": "volts of the potentiometer; physical: sinkage z",
    "motor_shunt": "volts of the current shunt's amplifier; physical: motor current",
    "wrench": "force/torque sensor: fx drawbar pull, fy side force, fz load, ty torque at the axle",
    "motor_temperature": "degrees Celsius of the winding",
}

# No reading is exact. Less than this is a slip of the pen: the filter divides by its square.
LEAST_NOISE = 1e-9  # in every raw unit


@dataclass(frozen=True)
class Unlimited:
    """A limit that this kind of channel cannot have. The word stands in the effective text of
    earlier recordings.
    """

    value: Any
    reason: str

    @property
    def expected(self) -> str:
        return f"{UNLIMITED}: {self.reason}"

    def read(self, node: Node) -> tuple[Any, Node]:
        if not isinstance(node, Scalar) or node.text != UNLIMITED:
            raise node.place.error(describe(node), self.expected)
        return self.value, node


def _calibration(scale: str, offset: str, default_scale: str) -> dict[str, Key]:
    return {
        "scale": Key(
            uncertain(scale),
            "physical = raw · scale + offset; its sigma is that of the slope about physical zero",
            default_scale,
        ),
        "offset": Key(
            uncertain(offset, low=-1e6, high=1e6),
            "see `scale`; its sigma is that of the zero: the physical value read at rest",
            f"0 {offset}",
        ),
        "date": Key(
            Text("a date such as 2026-11-20", r"|\d{4}-\d\d-\d\d"), "day of the calibration", "''"
        ),
        "serial": Key(Text(), "serial number of the sensor", "''"),
    }


def _timing() -> dict[str, Key]:
    return {
        "latency": Key(
            NumberWithUnit("s", low=0, high=1),
            "a sample is older than its stamp by this much",
            "0 ms",
        ),
        "stale_after": Key(
            NumberWithUnit("s", above=0, high=10),
            "silence after which the channel is stale",
            "40 ms",
        ),
    }


def _source() -> dict[str, Key]:
    return {
        "device": Key(NAME, "name of the device it comes from"),
        "signal": Key(NAME, "key in the serial frame, or Message.Signal of the CAN database"),
    }


def _channel(name: str) -> Section:
    """Keys of one channel, in its units."""
    raw, physical, step = UNITS[name]
    slope = f"{physical}/{raw}"
    keys = _source() | (
        _calibration("", "K", "1.0") if raw == "degC" else _calibration(slope, physical, NEEDED)
    )
    keys["noise"] = Key(
        NumberWithUnit(step, above=LEAST_NOISE), "standard deviation of one reading"
    )

    if name in ENCODERS:
        max_rate = NumberWithUnit(f"{step}/s", above=0, unlimited=True)
        keys["range"] = Key(
            Unlimited((-inf, inf), "no count is impossible, max_rate tells a jump"),
            "none",
            UNLIMITED,
        )
        keys["bits"] = Key(Integer(8, 64), "width of the counter on the wire", "32")
        keys["modulus"] = Key(
            Integer(2, 1 << 64), "counts at which it wraps, where that is not 2^bits", ABSENT
        )
        keys["resolution"] = Key(
            NumberWithUnit("", above=0),
            "what one count is in the number sent, where turns, degrees or a scaled number are",
            ABSENT,
        )
        keys["max_rate"] = Key(
            max_rate, "fastest believable change; a faster one is a counter jump", UNLIMITED
        )
    else:
        keys["range"] = Key(
            Interval(NumberWithUnit(raw)), "valid readings; one outside is quarantined"
        )
        keys["max_rate"] = Key(
            Unlimited(inf, "only an encoder's counts can jump"), "none", UNLIMITED
        )

    return Section(keys | _timing(), partial(_build_channel, name))


def _build_channel(name: str, **values: Any) -> Channel:
    low, high = values.pop("range")
    calibration = _build_calibration(
        **{key: values.pop(key) for key in ("scale", "offset", "date", "serial")}
    )
    return Channel(name=name, calibration=calibration, low=low, high=high, **values)


def _build_calibration(scale: Uncertain, **values: Any) -> Calibration:
    if scale.value == 0.0:
        raise Impossible("scale", "a scale other than 0", "0")
    if scale.sigma > abs(scale.value):
        raise Impossible("scale.sigma", "no more than the scale itself")

    return Calibration(scale, **values)


WRENCH = {
    "device": Key(NAME, "name of the device it comes from"),
    "signal": Key(NAME, "key in the serial frame, or the messages of the CAN database"),
    "drawbar_pull": Key(
        Section(_calibration("", "N", "1.0"), _build_calibration), "calibration of fx", "{}"
    ),
    "load": Key(
        Section(_calibration("", "N", "1.0"), _build_calibration), "calibration of fz", "{}"
    ),
    "torque": Key(
        Section(_calibration("", "N*m", "1.0"), _build_calibration), "calibration of ty", "{}"
    ),
    "side_force": Key(
        Section(_calibration("", "N", "1.0"), _build_calibration),
        "calibration of fy, positive to either side; without it the side force is recorded only",
        ABSENT,
    ),
    "force_noise": Key(
        NumberWithUnit("N", above=LEAST_NOISE), "standard deviation of one force reading"
    ),
    "torque_noise": Key(
        NumberWithUnit("N*m", above=LEAST_NOISE), "standard deviation of one torque reading"
    ),
    "max_force": Key(NumberWithUnit("N", above=0), "a larger force is quarantined", "10 kN"),
    "max_torque": Key(NumberWithUnit("N*m", above=0), "a larger torque is quarantined", "1 kN*m"),
}


def channels() -> Section:
    """The channels by name; the optional ones may be absent."""
    keys = {
        name: Key(
            Section(WRENCH | _timing(), Wrench) if name == "wrench" else _channel(name),
            CHANNEL_DOCS[name],
            NEEDED if name in (*MOTION, "motor_shunt") else ABSENT,
        )
        for name in CHANNELS
    }
    return Section(keys, dict)
