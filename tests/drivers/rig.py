"""What the driver tests share: settings for any wiring, pseudo-terminals that can be unplugged,
waiting.
"""

from __future__ import annotations

import os
import pty
import random
import select
import time
import tty
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from hypothesis import settings

from gritd.drivers.framing_can import EXTENDED, pack
from gritd.estimator.config.settings import Channel, Device, Settings, Wrench
from tests.rig import SETTINGS, calibration

DBC = str(Path(__file__).parents[2] / "config" / "testbed.dbc")
FUZZ = settings(max_examples=200)
INF = float("inf")

CAN_SIGNALS = {
    "wheel_encoder": "WheelEncoder.Count",
    "carriage_encoder": "CarriageEncoder.Count",
    "sinkage_pot": "SinkagePot.Volts",
    "motor_shunt": "MotorShunt.Volts",
    "motor_temperature": "MotorTemperature.Celsius",
}


def channel(name, device, signal=None, low=-INF, high=INF, bits=32):
    return Channel(name, device, signal or name, calibration(1.0), 0.0, low, high, bits=bits)


def wrench(device, signal="wrench", max_force=500.0, max_torque=50.0):
    one = calibration(1.0)
    return Wrench(device, signal, one, one, one, 0.1, 0.01, max_force, max_torque)


def serial_device(port="/dev/null", framing="cobs", name="encoders"):
    return Device(name, "serial", port=str(port), framing=framing)


def can_device(interface="virtual", channel="test", name="bus", **values):
    return Device(name, "can", interface=interface, channel=channel, **{"dbc": DBC, **values})


def wiring(devices, channels, wrench=None) -> Settings:
    return replace(
        SETTINGS,
        devices={device.name: device for device in devices},
        channels={channel.name: channel for channel in channels},
        wrench=wrench,
    )


class Ticking:
    """A clock for readers: the monotonic clock from a fixed start."""

    def __init__(self) -> None:
        self._zero = time.monotonic_ns()

    def __call__(self) -> int:
        return 1_700_000_000_000_000_000 + time.monotonic_ns() - self._zero


class Plug:
    """A serial device on a pseudo-terminal behind a fixed path; it can be unplugged and plugged in
    again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._master = -1
        self.plug_in()

    def plug_in(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.path.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._master)
        self._master = -1

    def send(self, data: bytes) -> None:
        """Now or never, as on a wire: BlockingIOError if nobody reads."""
        os.write(self._master, data)

    def deliver(self, data: bytes) -> None:
        """All of it, however slow the reader is."""
        view = memoryview(data)
        while view:
            _, writable, _ = select.select([], [self._master], [], 0.01)
            if writable:
                with suppress(BlockingIOError):
                    view = view[os.write(self._master, view) :]

    def close(self) -> None:
        if self._master >= 0:
            os.close(self._master)


def wait_until(condition, limit=120.0) -> bool:
    """Poll until the condition holds; the limit only ends a test that fails."""
    end = time.monotonic() + limit
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True


def damage(rng: random.Random, data: bytes, at: int) -> bytes:
    """One fault at a byte: flipped bits, deleted, inserted or overwritten bytes."""
    length = rng.randint(1, 3)
    kind = rng.randrange(4)
    if kind == 0:
        return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
    if kind == 1:
        return data[:at] + data[at + length :]
    noise = rng.randbytes(length)
    return data[:at] + noise + data[at if kind == 2 else at + length :]


def chunk(message):
    return pack(
        message.arbitration_id | (EXTENDED if message.is_extended_id else 0), bytes(message.data)
    )
