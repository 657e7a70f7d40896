"""Where the signals of a CAN bus lie in its messages: a DBC file, or inline definitions. One
database for both.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from gritd.drivers.can_libraries import BaseConversion, Database, Message, Signal, cantools
from gritd.drivers.dbc import MAX_MESSAGE, DbcError, DbcFile
from gritd.drivers.errors import DeviceSettingsError
from gritd.estimator.config.settings import Device

MAX_INLINE = 256  # signals of one device

Definition = Mapping[str, object]

# key of an inline definition -> (default or None if it must be given, test, what is expected)
_Rule = tuple[object, Callable[[Any], bool], str]
RULES: dict[str, _Rule] = {
    "id": (None, lambda v: _is_int(v) and 0 <= v < 1 << 29, "a frame id below 2^29"),
    "start": (None, lambda v: _is_int(v) and 0 <= v < 512, "a start bit of 0 to 511"),
    "length": (None, lambda v: _is_int(v) and 1 <= v <= 64, "a length of 1 to 64 bits"),
    "byte_order": (
        "little_endian",
        lambda v: v in ("little_endian", "big_endian"),
        "little_endian or big_endian",
    ),
    "signed": (False, lambda v: isinstance(v, bool), "true or false"),
    "is_float": (False, lambda v: isinstance(v, bool), "true or false"),
    "extended": (False, lambda v: isinstance(v, bool), "true or false"),
    "scale": (1, lambda v: _is_number(v) and v != 0, "a number other than 0"),
    "offset": (0, lambda v: _is_number(v), "a number"),
}


def database(device: Device, keys: Iterable[str] | None = None) -> Database:
    """The message database of a CAN device. keys: what is listened to, `Message` or
    `Message.Signal`; a file is read as far as they need it. Raises DeviceSettingsError where file
    or definitions are wrong.
    """
    if device.dbc and device.signals:
        raise DeviceSettingsError(
            f"device {device.name}", "both dbc and signals are given, expected one of them"
        )

    if device.signals:
        return _inline(device)
    if device.dbc:
        return _from_file(device, None if keys is None else _messages(keys))
    raise DeviceSettingsError(
        f"device {device.name}", "neither dbc nor signals is given, expected one of them"
    )


def amiss_elsewhere(device: Device, keys: Iterable[str]) -> str:
    """What is wrong in a device's file with messages that nobody listens to; ''. Raises
    DeviceSettingsError.
    """
    with _named(device):
        file = DbcFile(device.dbc, _messages(keys), elsewhere=True) if device.dbc else None
        wrong = file.amiss_elsewhere() if file else ""
    return f"{device.dbc}: {wrong}" if wrong else ""


def _messages(keys: Iterable[str]) -> set[str]:
    return {key.partition(".")[0] for key in keys}


def _from_file(device: Device, names: Collection[str] | None) -> Database:
    with _named(device):
        return DbcFile(device.dbc, names).database()


@contextmanager
def _named(device: Device) -> Iterator[None]:
    """A fault of the file with the names of device and file."""
    try:
        yield
    except DbcError as error:
        raise DeviceSettingsError(f"device {device.name}", f"{device.dbc}: {error}") from None


def _inline(device: Device) -> Database:
    """Messages from definitions named Message.Signal."""
    if len(device.signals) > MAX_INLINE:
        reason = f"{len(device.signals)} signals, expected at most {MAX_INLINE}"
        raise DeviceSettingsError(f"device {device.name}", reason)

    messages: dict[str, dict[str, dict[str, Any]]] = {}
    for name, definition in device.signals.items():
        where = f"device {device.name}, signal {name}"
        message, dot, signal = name.partition(".")
        if not (message and dot and signal):
            raise DeviceSettingsError(where, "expected a name of the form Message.Signal")
        messages.setdefault(message, {})[signal] = _checked(where, definition)

    return Database([_message(device, name, signals) for name, signals in messages.items()])


def _checked(where: str, definition: Definition) -> dict[str, Any]:
    """The definition, complete, each value of the right kind."""
    for key in definition:
        if key not in RULES:
            raise DeviceSettingsError(
                where, f"unknown key {key!r}, expected some of {', '.join(RULES)}"
            )

    values = {}
    for key, (default, valid, expected) in RULES.items():
        values[key] = definition.get(key, default)
        if not valid(values[key]):
            raise DeviceSettingsError(
                where, f"{key} is {definition.get(key)!r}, expected {expected}"
            )

    if values["is_float"] and values["length"] not in (32, 64):
        raise DeviceSettingsError(
            where, f"length is {values['length']}, expected 32 or 64 bits for a float"
        )

    return values


def _message(device: Device, name: str, signals: dict[str, dict[str, Any]]) -> Message:
    first = next(iter(signals.values()))
    if any((s["id"], s["extended"]) != (first["id"], first["extended"]) for s in signals.values()):
        raise DeviceSettingsError(
            f"device {device.name}, message {name}", "its signals differ in id or extended"
        )

    built = [_signal(signal, values) for signal, values in signals.items()]
    length = max(map(_bytes_reached, built))
    if length > MAX_MESSAGE:
        reason = f"its signals reach to byte {length}, expected at most {MAX_MESSAGE}"
        raise DeviceSettingsError(f"device {device.name}, message {name}", reason)

    try:
        return Message(
            first["id"], name, length, built, is_extended_frame=first["extended"], strict=True
        )
    except cantools.Error as error:
        raise DeviceSettingsError(f"device {device.name}, message {name}", error) from None


def _bytes_reached(signal: Signal) -> int:
    """Length of the shortest message that holds the signal."""
    if signal.byte_order == "little_endian":
        return -(-(signal.start + signal.length) // 8)
    first_byte, top_bit = divmod(signal.start, 8)
    return first_byte + 1 + -(-max(signal.length - top_bit - 1, 0) // 8)


def _signal(name: str, values: dict[str, Any]) -> Signal:
    conversion = BaseConversion.factory(
        scale=values["scale"], offset=values["offset"], is_float=values["is_float"]
    )

    return Signal(
        name,
        values["start"],
        values["length"],
        byte_order=values["byte_order"],
        is_signed=values["signed"],
        conversion=conversion,
    )


def _is_int(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    return (
        isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")
    )
