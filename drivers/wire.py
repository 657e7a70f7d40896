"""The sending end, for a simulated testbed: the bytes that a device of this configuration would
send.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from gritd.drivers import framing_ascii, framing_cobs
from gritd.drivers.can_libraries import Message, Signal, can
from gritd.drivers.can_signals import database
from gritd.drivers.framing import CLOCK_MODULUS, SEQUENCE_MODULUS, FieldValue, Frame
from gritd.drivers.framing_can import COUNTERS, DEVICE_TIME
from gritd.estimator.config.settings import Device


class SerialWire:
    """Frames of a serial device, numbered in the order they are sent."""

    def __init__(self, device: Device) -> None:
        self._encode = {"ascii": framing_ascii.encode, "cobs": framing_cobs.encode}[device.framing]
        self._sequence = 0

    def encode(self, key: str, values: Sequence[FieldValue], device_us: int | None = None) -> bytes:
        """The bytes of one frame; device_us [µs] may run past its wrap. Counters must have wrapped
        already.
        """
        wrapped = None if device_us is None else device_us % CLOCK_MODULUS
        frame = Frame(key, self._sequence, wrapped, tuple(values))
        self._sequence = (self._sequence + 1) % SEQUENCE_MODULUS
        return self._encode(frame)


class CanWire:
    """Messages of a CAN device, each kind numbered for itself."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._messages: dict[str, Message] = {}
        self._sequence: Counter[str] = Counter()

    def encode(
        self, key: str, values: Sequence[FieldValue], device_us: int | None = None
    ) -> can.Message:
        """The message of a key, `Message` or `Message.Signal`; signals that are not given are 0.

        A value outside the signal's stated range is sent all the same: a broken sensor does so.
        Raises an error of cantools or bitstruct if it does not fit the bits.
        """
        name, _, signal = key.partition(".")
        message = self._messages.get(name) or self._read(name)
        data = _data(message)
        given = dict(zip([signal] if signal else data, values, strict=True))
        fields = {s.name: given.get(s.name, 0) for s in message.signals} | self._counters(
            message, device_us or 0
        )

        return can.Message(
            arbitration_id=message.frame_id,
            is_extended_id=message.is_extended_frame,
            is_fd=message.length > 8,
            data=message.encode(fields, strict=False),
        )

    def width(self, key: str) -> int:
        """How many values the message of a key holds."""
        name, _, signal = key.partition(".")
        return 1 if signal else len(_data(self._messages.get(name) or self._read(name)))

    def _read(self, name: str) -> Message:
        message = database(self._device, [name]).get_message_by_name(name)
        self._messages[name] = message
        return message

    def _counters(self, message: Message, device_us: int) -> dict[str, FieldValue]:
        """Values of the message counter and of the device time, where the message has them."""
        number = self._sequence[message.name]
        self._sequence[message.name] += 1
        counters: dict[str, FieldValue] = {}
        for signal in message.signals:
            if signal.name.lower() in COUNTERS:
                counters[signal.name] = number % (1 << signal.length)
            elif signal.name.lower() == DEVICE_TIME:
                counters[signal.name] = _wrapped_time(signal, device_us)
        return counters


def _data(message: Message) -> list[str]:
    """Names of the signals that are neither counter nor time."""
    return [s.name for s in message.signals if s.name.lower() not in (*COUNTERS, DEVICE_TIME)]


def _wrapped_time(signal: Signal, device_us: int) -> FieldValue:
    """Device time [µs], cut to the signal's resolution and width."""
    ticks = int(device_us // signal.scale) % (1 << signal.length)
    return ticks * signal.scale
