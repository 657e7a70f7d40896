"""A CAN bus through python-can: socketcan in production; slcan, udp_multicast or virtual without
such hardware.
"""

from __future__ import annotations

import errno
import os
import socket
import stat
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from gritd.drivers.can_libraries import can
from gritd.drivers.errors import DeviceError
from gritd.drivers.framing_can import ERROR, EXTENDED, HEAD, REMOTE, AcceptedIdentifiers, pack
from gritd.drivers.link import POLL, Chunk, Clock
from gritd.drivers.port import Port
from gritd.drivers.port_lock import held
from gritd.drivers.slcan import LONGEST_LINE, SlcanLines
from gritd.estimator.config.settings import Device

# [bytes] asked of the kernel, so that a burst waits there instead of being lost
RECEIVE_BUFFER = 1 << 20

# Options an interface needs to be safe or prompt; the configuration's `options` win.
DEFAULTS: dict[str, dict[str, Any]] = {
    "udp_multicast": {"hop_limit": 0},  # never leaves this machine
    "slcan": {"sleep_after_open": 0.1},  # the library's 2 s would outlast a stop
}


Decode = Callable[[bytes], tuple[bytes, int]]  # bytes read -> messages packed, messages damaged


class CanLink:
    """Messages of the wanted ids only: the filters are given to the bus, which gives them to kernel
    or hardware.

    filters: as python-can takes them, from CanFraming.filters().
    """

    def __init__(
        self, device: Device, filters: Sequence[dict[str, int | bool]], clock: Clock
    ) -> None:
        self.damaged = 0
        self._device = device
        self._filters = filters
        self._clock = clock
        self._bus: can.BusABC | None = None
        self._lock = -1  # of the port behind the bus
        self._direct: tuple[Port, Decode] | None = None  # past python-can, which is slower

    def open(self) -> None:
        device = self._device
        options = {
            "bitrate": device.bitrate,
            **DEFAULTS.get(device.interface, {}),
            **device.options,
        }

        try:
            self._lock = held(port) if (port := port_of(device)) else -1
            bus = can.Bus(
                device.channel,
                device.interface,
                ignore_config=True,
                can_filters=list(self._filters),
                **options,
            )
        except Exception as error:  # every backend has exceptions of its own
            self._unlock()
            where = f"{device.interface} {device.channel}"
            raise DeviceError(device.name, f"cannot open {where}: {_reason(error)}") from None

        _enlarge_receive_buffer(bus)
        self._bus, self._direct = bus, self._past(bus)

    def _past(self, bus: can.BusABC) -> tuple[Port, Decode] | None:
        """How to read an open bus without python-can; None where that is not known."""
        with suppress(Exception):  # an adapter that is reached over a network has no descriptor
            if self._device.interface == "socketcan":
                return Port(bus.fileno()), of_kernel
            if self._device.interface == "slcan":
                return Port(bus.fileno()), SlcanLines(AcceptedIdentifiers(self._filters)).decode
        return None

    def read(self) -> Chunk | None:
        if self._bus is None:
            raise DeviceError(self._device.name, f"{self._device.channel} is not open")

        try:
            return self._take(*self._direct) if self._direct else self._receive(self._bus)
        except Exception as error:  # every backend has exceptions of its own
            if not _is_damage(self._device.interface, error):
                raise DeviceError(
                    self._device.name, f"cannot read {self._device.channel}: {_reason(error)}"
                ) from None
            self._discard_damage(error)
            return None

    def _take(self, port: Port, decode: Decode) -> Chunk | None:
        data, received = port.read(), self._clock()
        messages, damaged = decode(data)
        self.damaged += damaged
        return Chunk(received, messages) if messages else None

    def _receive(self, bus: can.BusABC) -> Chunk | None:
        message = bus.recv(POLL)
        if message is not None:
            return Chunk(self._clock(), packed(message))
        self._discard_endless()
        return None

    def _discard_endless(self) -> None:
        """slcan keeps a line until it ends; one of a wrong baud rate never does."""
        line = getattr(self._bus, "_buffer", bytearray())
        if len(line) > LONGEST_LINE:
            self.damaged += 1
            line.clear()

    def _discard_damage(self, error: Exception) -> None:
        """Count a message that could not be read, and go on."""
        self.damaged += 1
        if isinstance(error.__cause__, UnicodeDecodeError) and self._bus is not None:
            with suppress(
                Exception
            ):  # slcan keeps an undecodable line for ever, unless it is asked to drop it
                self._bus._buffer.clear()  # type: ignore[attr-defined]

    def close(self) -> None:
        bus, self._bus, self._direct = self._bus, None, None
        self._unlock()
        if bus is None:
            return
        with suppress(Exception):  # a device that is gone cannot be stopped
            bus.shutdown()
        with suppress(Exception):  # slcan leaves its port open where that failed
            bus.serialPortOrig.close()  # type: ignore[attr-defined]

    def _unlock(self) -> None:
        lock, self._lock = self._lock, -1
        if lock >= 0:
            os.close(lock)


def port_of(device: Device) -> str:
    """The device file that a device has for itself; '' where there is none: a bus of the kernel
    and a multicast group are for all.
    """
    port = device.port if device.kind == "serial" else device.channel.partition("@")[0]
    shared = device.kind != "serial" and device.interface in ("socketcan", "udp_multicast")
    with suppress(OSError, ValueError):
        if not shared and stat.S_ISCHR(os.stat(port).st_mode):
            return port
    return ""


def packed(message: can.Message) -> bytes:
    """The message as a chunk of CanFraming. Raises struct.error, TypeError or ValueError if it is
    none.
    """
    # a hostile message has anything in the place of a flag
    flags = EXTENDED if message.is_extended_id else 0
    flags |= REMOTE if message.is_remote_frame else 0
    flags |= ERROR if message.is_error_frame else 0

    data = bytes(message.data)
    if message.dlc != len(data) and not message.is_remote_frame:
        raise ValueError(f"length {message.dlc}, but {len(data)} bytes")
    return pack(message.arbitration_id | flags, data)


def of_kernel(frame: bytes) -> tuple[bytes, int]:
    """A message as the kernel gives it, struct can_frame or canfd_frame of linux/can.h; nothing of
    no bytes. Raises struct.error where there are too few.
    """
    if not frame:
        return b"", 0
    can_id, length = HEAD.unpack_from(frame)
    data = b"" if can_id & REMOTE else frame[HEAD.size : HEAD.size + length]
    return pack(can_id, data), 0


def _is_damage(interface: str, error: Exception) -> bool:
    """Whether this is one unreadable message rather than a failing bus."""
    if isinstance(error, struct.error):
        return True
    if interface == "slcan":
        return isinstance(error.__cause__ or error, ValueError | IndexError)
    if interface == "udp_multicast":
        unpacking = isinstance(error, can.CanError) and error.__cause__ is not None
        return isinstance(error, TypeError) or (
            unpacking and not isinstance(error.__cause__, OSError)
        )

    return False


def _enlarge_receive_buffer(bus: can.BusABC) -> None:
    """Where the bus is a socket; a duplicate descriptor reaches the same one."""
    with suppress(Exception):  # a smaller buffer is no failure
        number = bus.fileno()
        if stat.S_ISSOCK(os.fstat(number).st_mode):
            with socket.socket(fileno=os.dup(number)) as same:
                same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)


def _reason(error: BaseException) -> str:
    """The innermost cause's words: python-can wraps the telling one."""
    while error.__cause__ is not None:
        error = error.__cause__
    number = getattr(error, "errno", None)
    if number == errno.EWOULDBLOCK:  # a port that is locked: its words name the holder
        return str(getattr(error, "strerror", error))
    return os.strerror(number) if isinstance(number, int) else str(error) or type(error).__name__
