"""A reader on a bus, and who sends to it."""

from __future__ import annotations

from gritd.drivers.build import build_readers
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.wire import CanWire
from tests.drivers.rig import (
    CAN_SIGNALS,
    Ticking,
    channel,
    wait_until,
    wiring,
    wrench,
)

LIMITS = {"sinkage_pot": (0.0, 5.0), "motor_shunt": (0.0, 5.0)}


def all_channels(device="bus"):
    return [
        channel(name, device, signal, *LIMITS.get(name, (-1e12, 1e12)))
        for name, signal in CAN_SIGNALS.items()
    ]


class Bus:
    """A reader on a bus, and the sending end."""

    def __init__(self, device, sender) -> None:
        self.wire = CanWire(device)
        self.sender = sender
        self.queue = ReadingQueue(1 << 20)
        settings = wiring([device], all_channels(), wrench("bus", "WrenchForce+WrenchTorque"))
        (self.reader,) = build_readers(settings, Ticking(), self.queue)
        self.reader.start()
        assert wait_until(lambda: self.reader.stats().state == "OPEN")

    def send(self, key, values, device_us=None):
        self.sender(self.wire.encode(key, values, device_us))

    def receive(self, count):
        got = []
        assert wait_until(
            lambda: len(got) >= count or got.extend(self.queue.drain()) or len(got) >= count
        )
        return got

    def one_of_each(self, n):
        device_us = 4000 * n
        self.send("WheelEncoder.Count", [100 * n % (1 << 32)], device_us)
        self.send("CarriageEncoder.Count", [-7 * n % (1 << 32)], device_us)
        self.send("SinkagePot.Volts", [1.5], device_us)
        self.send("MotorShunt.Volts", [2.5], device_us)
        self.send("MotorTemperature.Celsius", [25.5], device_us)
        self.send("WrenchForce", [1.0, 2.0, 3.0])
        self.send("WrenchTorque", [0.5, 0.25, -0.5])
