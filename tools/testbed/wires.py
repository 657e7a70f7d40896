"""The far ends of real wires: pseudo-terminals and a CAN bus on the loopback, and the devices that
speak on them.

Nothing here waits: what nobody reads is lost and counted, as on a wire.
"""

from __future__ import annotations

import os
import pty
import secrets
import socket
import tty
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Literal, Protocol

from gritd.drivers.build import build_decoder, used_devices
from gritd.drivers.can_libraries import can
from gritd.drivers.framing import FieldValue
from gritd.drivers.wire import CanWire, SerialWire
from gritd.estimator.config.settings import Channel, Device, Settings, Wrench
from gritd.estimator.messages.readings import Reading

CanKind = Literal["auto", "udp_multicast", "slcan"]
US = 1000  # [ns]


class FarEnd(Protocol):
    """What is connected to a port of the daemon's computer: one device, or all nodes of a bus."""

    device: Device  # as the daemon's configuration must name it

    @property
    def lost(self) -> int:
        """Messages nobody took."""

    def send(self, key: str, values: Sequence[FieldValue], device_us: int) -> None:
        """Put one sample on the wire, taken at `device_us` of the device's own clock [µs]."""

    def close(self) -> None: ...


class Terminal:
    """The master of a pseudo-terminal whose slave the daemon opens as a serial port."""

    def __init__(self) -> None:
        # held open, so that the raw mode outlives the daemon
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self.lost = 0

    def write(self, data: bytes) -> None:
        try:
            self.lost += os.write(self._master, data) < len(data)
        except BlockingIOError:
            self.lost += 1

    def discard(self) -> None:
        """Throw away what the daemon sent."""
        with suppress(BlockingIOError):
            os.read(self._master, 4096)

    def close(self) -> None:
        os.close(self._master)
        os.close(self._slave)


class SerialDevice:
    """A microcontroller on a serial port."""

    def __init__(self, device: Device) -> None:
        self._terminal = Terminal()
        self.device = replace(device, port=self._terminal.path)
        self._wire = SerialWire(device)

    @property
    def lost(self) -> int:
        return self._terminal.lost

    def send(self, key: str, values: Sequence[FieldValue], device_us: int) -> None:
        self._terminal.write(self._wire.encode(key, values, device_us))

    def close(self) -> None:
        self._terminal.close()


class MulticastBus:
    """The nodes of a CAN bus that is a multicast group of this computer; no datagram leaves it (hop
    limit 0).

    Raises OSError or can.CanError where the computer has no interface that could carry one.
    """

    def __init__(self, device: Device) -> None:
        group = f"239.255.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"
        options: dict[str, str | int | float | bool] = {"port": _free_port(), "hop_limit": 0}
        self.device = replace(device, interface="udp_multicast", channel=group, options=options)
        self.lost = 0

        self._wire = CanWire(device)
        self._bus = can.Bus(
            group,
            "udp_multicast",
            ignore_config=True,
            **options,  # type: ignore[arg-type]
        )

    def send(self, key: str, values: Sequence[FieldValue], device_us: int) -> None:
        for message in messages(self._wire, key, values, device_us):
            try:
                self._bus.send(message)
            except (OSError, can.CanError):
                self.lost += 1

    def close(self) -> None:
        self._bus.shutdown()


class SlcanBus:
    """The nodes of a CAN bus behind a serial adapter (slcan), for a computer without multicast."""

    def __init__(self, device: Device) -> None:
        self._terminal = Terminal()
        self.device = replace(device, interface="slcan", channel=self._terminal.path, options={})
        self._wire = CanWire(device)

    @property
    def lost(self) -> int:
        return self._terminal.lost

    def send(self, key: str, values: Sequence[FieldValue], device_us: int) -> None:
        self._terminal.discard()
        for message in messages(self._wire, key, values, device_us):
            self._terminal.write(slcan_line(message))

    def close(self) -> None:
        self._terminal.close()


def connect(device: Device, bus: CanKind = "auto") -> FarEnd:
    """The far end of a configured device, on a wire of this computer instead of its own."""
    if device.kind == "serial":
        return SerialDevice(device)
    if bus == "slcan" or (bus == "auto" and not has_multicast()):
        return SlcanBus(device)
    return MulticastBus(device)


def has_multicast() -> bool:
    """Whether this computer has an interface that takes multicast; a container without a network
    has none.
    """
    membership = socket.inet_aton("239.255.0.1") + socket.inet_aton("0.0.0.0")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        except OSError:
            return False
    return True


def messages(
    wire: CanWire, key: str, values: Sequence[FieldValue], device_us: int
) -> list[can.Message]:
    """The messages of one sample; of a key `First+Second` each takes as many values as it holds."""
    made, rest = [], values
    for name in key.split("+"):
        width = wire.width(name)
        made.append(wire.encode(name, rest[:width], device_us))
        rest = rest[width:]
    return made


def slcan_line(message: can.Message) -> bytes:
    """A message as a serial CAN adapter writes it."""
    head = (
        f"T{message.arbitration_id:08X}"
        if message.is_extended_id
        else f"t{message.arbitration_id:03X}"
    )
    return f"{head}{message.dlc}{bytes(message.data).hex().upper()}\r".encode()


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


class ConnectedDevices:
    """All devices of a configuration, connected: a reading goes in, its bytes come out on the right
    wire.

    settings: the devices in them are replaced by those of `devices` for the daemon.
    """

    def __init__(self, settings: Settings, bus: CanKind = "auto") -> None:
        sources: dict[str, Channel | Wrench] = {**settings.channels}
        if settings.wrench is not None:
            sources["wrench"] = settings.wrench
        used = {source.device for source in sources.values()}
        self._ends = {name: connect(settings.devices[name], bus) for name in sorted(used)}
        self._sources = sources
        self._sensors = {
            sensor.channel: sensor
            for device in used_devices(settings)
            for sensor in build_decoder(settings, device).sensors
        }

    @property
    def devices(self) -> dict[str, Device]:
        """By name, as the daemon's configuration must have them."""
        return {name: end.device for name, end in self._ends.items()}

    @property
    def lost(self) -> dict[str, int]:
        """Messages nobody took, by device."""
        return {name: end.lost for name, end in self._ends.items()}

    def send(self, reading: Reading) -> None:
        """Put a reading on its wire now, with its stamp as the device's clock."""
        source = self._sources[reading.channel]
        values = self._sensors[reading.channel].sent(reading.value)
        self._ends[source.device].send(source.signal, values, reading.stamp // US)

    def __enter__(self) -> ConnectedDevices:
        return self

    def __exit__(self, *error: object) -> None:
        for end in self._ends.values():
            end.close()
