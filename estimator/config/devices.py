"""The part of the configuration's format that says where sensors are connected: serial ports and
CAN buses.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from gritd.estimator.config.kinds import Choice, FilePath, Integer, NumberWithUnit, Text, YesNo
from gritd.estimator.config.schema import ABSENT, Impossible, Key, Named, Options, Section, Variant
from gritd.estimator.config.settings import Device

NAME = Text("a name", r".*\S.*")

SERIAL = {
    "kind": Key(Choice(("serial",)), "a serial port"),
    "port": Key(
        NAME, "path of the port; one in /dev/serial/by-id stays when ports are numbered anew"
    ),
    "baud": Key(Integer(300, 12_000_000), "bits per second", "115200"),
    "framing": Key(
        Choice(("cobs", "ascii")),
        "COBS with CRC-16 and sequence number, or lines with a checksum",
        "cobs",
    ),
}


SIGNAL = {
    "id": Key(Integer(0, 2**29 - 1), "frame id"),
    "start": Key(Integer(0, 511), "start bit, as in a DBC"),
    "length": Key(Integer(1, 64), "bits"),
    "byte_order": Key(Choice(("little_endian", "big_endian")), "default little_endian", ABSENT),
    "signed": Key(YesNo(), "default false", ABSENT),
    "is_float": Key(YesNo(), "IEEE 754, default false", ABSENT),
    "extended": Key(YesNo(), "29-bit frame id, default false", ABSENT),
    "scale": Key(NumberWithUnit(""), "value = bits · scale + offset; default 1", ABSENT),
    "offset": Key(NumberWithUnit(""), "default 0", ABSENT),
}


def _signal(**values: Any) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _can(folder: Path | None) -> dict[str, Key]:
    return {
        "kind": Key(Choice(("can",)), "a CAN bus"),
        "interface": Key(NAME, "name of a python-can interface", "socketcan"),
        "channel": Key(NAME, "channel of that interface", "can0"),
        "bitrate": Key(Integer(10_000, 1_000_000), "bits per second", "500000"),
        "dbc": Key(
            FilePath(folder),
            "CAN database; a relative path counts from the folder of this file",
            "''",
        ),
        "options": Key(Options(), "further arguments of the python-can interface", "{}"),
        "signals": Key(
            Named(Section(SIGNAL, _signal), lambda _, value: value),
            "signals defined here instead of in a DBC, by names Message.Signal",
            "{}",
        ),
    }


def device(folder: Path | None) -> Variant:
    return Variant(
        "kind", {"serial": Section(SERIAL, partial(Device, "")), "can": Section(_can(folder), _bus)}
    )


def _bus(dbc: str, signals: dict[str, Any], **values: Any) -> Device:
    if bool(dbc) == bool(signals):
        raise Impossible(
            "signals" if dbc else "dbc", "either a CAN database or signals defined here"
        )
    return Device("", dbc=dbc, signals=signals, **values)
