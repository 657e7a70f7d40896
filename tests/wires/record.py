"""Record sessions anew: `python -m tests.wires.record [--outcomes] [NAME…]`.

The daemon runs on pseudo-terminals and a bus, the simulated testbed drives, something is done to
the wires, and `--tap` keeps the bytes. It is the real process on the present machine: no two
recordings of a session are the same.
"""

from __future__ import annotations

import argparse
import lzma
import random
import signal
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import yaml

from gritd.drivers.wire import SerialWire
from gritd.drivers.wire_log import read_wire
from gritd.tools.testbed.wires import messages, slcan_line
from tests.drivers.rig import damage
from tests.scenarios.rig import DaemonProcess, Wires, driven
from tests.wires.library import FOLDER, Session, keep, outcome, sessions

SECONDS = 2.4  # of driving that are kept
MIDDLE = 1.6  # [s] after the beginning, something happens
NARROW = {name: {"bits": 16} for name in ("wheel_encoder", "carriage_encoder")}
PAUSE = 0.15  # [s]


class Meddler:
    """Stands between the encoders and their wire, and does nothing."""

    changes: ClassVar = {}  # of the configuration
    bus = "slcan"

    def __init__(self, wires, daemon):
        self.daemon, self.wires, self.rng = daemon, wires, random.Random(1)
        self.far = wires.encoders
        self._send, wires.encoders.send = wires.encoders.send, self.send
        self._bus_send, wires.bus.send = wires.bus.send, self.send_bus
        self.begun = time.monotonic()

    @property
    def on(self):
        return MIDDLE < time.monotonic() - self.begun < MIDDLE + PAUSE

    def send(self, key, values, device_us):
        self._send(key, values, device_us + 5_000_000)

    def send_bus(self, key, values, device_us):
        self._bus_send(key, values, device_us)

    def raw(self, data):
        with suppress(OSError):
            self.far.plug.send(data)

    def middle(self):
        """Once, in the middle."""


class Multicast(Meddler):
    bus = "udp_multicast"


class Ascii(Meddler):
    changes: ClassVar = {"devices": {"encoders": {"framing": "ascii"}}}

    def __init__(self, wires, daemon):
        super().__init__(wires, daemon)
        self.far.wire = SerialWire(replace(self.far.device, framing="ascii"))


class Noise(Meddler):
    def send(self, key, values, device_us):
        if self.rng.random() < 0.05:
            self.raw(self.rng.randbytes(self.rng.randint(1, 40)))
        super().send(key, values, device_us)


class Flipped(Meddler):
    def send(self, key, values, device_us):
        data = self.far.wire.encode(key, values, device_us + 5_000_000)
        hit = self.rng.random() < 0.05
        self.raw(damage(self.rng, data, self.rng.randrange(len(data))) if hit else data)


class Reconnect(Meddler):
    def middle(self):
        self.far.plug.unplug()
        time.sleep(PAUSE)
        self.far.plug.plug_in()


class Wraps(Meddler):
    """Both counters begin just below a wrap; the carriage's goes down through zero."""

    changes: ClassVar = {"channels": NARROW}

    def send(self, key, values, device_us):
        (count,) = values
        shown = 65_400 + count if key == "wheel_encoder" else 40 + count
        super().send(key, (shown % 65_536,), device_us)


class Step(Meddler):
    def send(self, key, values, device_us):
        step = 200_000 if time.monotonic() - self.begun > MIDDLE else 0
        super().send(key, values, device_us - step)


class Stamps(Meddler):
    def send(self, key, values, device_us):
        wrong = 65_536 if key == "wheel_encoder" and self.rng.random() < 0.005 else 0
        super().send(key, values, device_us + wrong)


class Restart(Meddler):
    """The microcontroller starts anew: its clock and its counters begin at zero."""

    _zero = None

    def send(self, key, values, device_us):
        if time.monotonic() - self.begun > MIDDLE + PAUSE:
            self._zero = self._zero or (device_us, {})
            began, counts = self._zero
            first = counts.setdefault(key, values[0])
            self._send(key, (values[0] - first,), device_us - began + 1000)
        elif not self.on:
            super().send(key, values, device_us)


class Garbage(Meddler):
    """8 MB as fast as they are taken, the same 2 kB again and again. Meanwhile one frame in twenty
    is sent: the log shall be short.
    """

    _flooded = False

    def send(self, key, values, device_us):
        if not self._flooded or self.rng.random() < 0.05:
            super().send(key, values, device_us)

    def send_bus(self, key, values, device_us):
        if not self._flooded or self.rng.random() < 0.05:
            super().send_bus(key, values, device_us)

    def middle(self):
        self._flooded = True
        noise, sent = random.Random(1).randbytes(2048), 0
        while sent < 4000:
            with suppress(BlockingIOError):
                self.far.plug.send(noise)
                sent += 1
                continue
            time.sleep(0.0005)
        self._flooded = False


class Silence(Meddler):
    changes: ClassVar = {"channels": NARROW}

    def send(self, key, values, device_us):
        if not MIDDLE < time.monotonic() - self.begun < MIDDLE + 0.5:
            super().send(key, tuple(value % 65_536 for value in values), device_us)


class Counter(Meddler):
    def send(self, key, values, device_us):
        wild = MIDDLE < time.monotonic() - self.begun < MIDDLE + 0.6 and key == "wheel_encoder"
        super().send(key, (self.rng.randrange(1 << 32),) if wild else values, device_us)


class Jump(Meddler):
    def send(self, key, values, device_us):
        later = time.monotonic() - self.begun > MIDDLE and key == "wheel_encoder"
        super().send(key, tuple(value + 100_000 * later for value in values), device_us)


class Lost(Meddler):
    def send(self, key, values, device_us):
        data = self.far.wire.encode(key, values, device_us + 5_000_000)
        if self.rng.random() > 0.03:
            self.raw(data)


class Twice(Meddler):
    def send(self, key, values, device_us):
        data = self.far.wire.encode(key, values, device_us + 5_000_000)
        self.raw(data * (1 + (self.rng.random() < 0.03)))


class NoNumbers(Meddler):
    def send_bus(self, key, values, device_us):
        if key == "SinkagePot.Volts" and self.rng.random() < 0.05:
            values = (self.rng.choice([float("nan"), float("inf"), -7.0, 4.95]),)
        super().send_bus(key, values, device_us)


class FrozenPot(Meddler):
    """A converter of 12 bits whose input hangs, and whose last digit dithers."""

    def send_bus(self, key, values, device_us):
        if key == "SinkagePot.Volts" and time.monotonic() - self.begun > MIDDLE - 0.4:
            values = (1.25 + self.rng.randrange(2) * 5.0 / 4096,)
        super().send_bus(key, values, device_us)


class LateWrench(Meddler):
    """A gateway keeps four cycles of the wrench and sends each one's messages in any order."""

    def __init__(self, wires, daemon):
        super().__init__(wires, daemon)
        self._waiting = []

    def send_bus(self, key, values, device_us):
        if not key.startswith("Wrench"):
            super().send_bus(key, values, device_us)
            return
        self._waiting.append(messages(self.wires.bus.wire, key, values, device_us))
        if len(self._waiting) == 4:
            for cycle in self._waiting:
                self.rng.shuffle(cycle)
                with suppress(OSError):
                    self.wires.bus.plug.send(b"".join(map(slcan_line, cycle)))
            self._waiting.clear()


class Stalled(Meddler):
    def middle(self):
        self.daemon.signal(signal.SIGSTOP)
        time.sleep(0.3)
        self.daemon.signal(signal.SIGCONT)


# All but `wrench-late` were recorded of a wrench without a device time (their `changes` say so);
# `starved` was recorded as good-slcan on a computer that was overloaded
SESSIONS = {
    "good-slcan": (Meddler, "nothing happens; CAN by a serial adapter"),
    "good-multicast": (Multicast, "nothing happens; CAN by datagrams"),
    "good-ascii": (Ascii, "nothing happens; the encoders speak lines of text"),
    "noise": (Noise, "bytes of noise between one frame in twenty and the next"),
    "flipped-bits": (Flipped, "one frame in twenty has bytes flipped, missing or added"),
    "reconnect": (Reconnect, "the encoders' plug is pulled and put back"),
    "wraps": (Wraps, "counters of 16 bits go through their wraps"),
    "clock-step": (Step, "the clock of the encoders' device goes back by 0.2 s, for good"),
    "wrong-stamps": (Stamps, "single frames of the wheel encoder are stamped 65.5 ms too late"),
    "restart": (Restart, "the encoders' device starts anew: clock and counters begin at zero"),
    "garbage-8-mb": (Garbage, "8 MB of noise as fast as they are taken"),
    "silence-16-bit": (Silence, "counters of 16 bits are silent for half a second"),
    "random-counter": (Counter, "the wheel's counter shows anything for 0.6 s"),
    "counter-jump": (Jump, "the wheel's counter jumps by 100,000"),
    "frames-lost": (Lost, "three frames in a hundred are lost"),
    "frames-twice": (Twice, "three frames in a hundred come twice"),
    "no-numbers": (NoNumbers, "NaN, infinity and what is out of range from the potentiometer"),
    "frozen-pot": (FrozenPot, "the potentiometer hangs, but for its last digit"),
    "wrench-late": (LateWrench, "four cycles of the wrench come at once, each in any order"),
    "stalled": (Stalled, "the daemon's process is stopped for 0.3 s"),
}


def record(name):
    """One run of the daemon into the library."""
    meddler, about = SESSIONS[name]
    with tempfile.TemporaryDirectory() as box:
        folder = Path(box)
        with Wires(folder, bus=meddler.bus) as wires:
            changed(wires.config, meddler.changes)
            with DaemonProcess(wires.config, "--tap", str(folder / "wires")) as daemon:
                daemon.ready()
                meddling = meddler(wires, daemon)
                wires.play(driven(40.0, 1, skip=1.2))
                time.sleep(MIDDLE)
                meddling.middle()
                time.sleep(SECONDS - MIDDLE)
                wires._stop.set()
                daemon.stop()
        into = FOLDER / name
        into.mkdir(parents=True, exist_ok=True)
        for log in (folder / "wires").glob("*.wire"):
            assert any(chunk.data for chunk in read_wire(log)), log
            packed = lzma.compress(log.read_bytes(), preset=9 | lzma.PRESET_EXTREME)
            (into / f"{log.name}.xz").write_bytes(packed)
    keep(Session(name, about, meddler.changes, {}))


def changed(path, changes):
    document = yaml.safe_load(path.read_text())
    for section, entries in changes.items():
        for name, values in entries.items():
            document[section][name].update(values)
    path.write_text(yaml.safe_dump(document, allow_unicode=True, sort_keys=False))


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.wires.record")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SESSIONS))
    parser.add_argument("--outcomes", action="store_true", help="only write the outcomes anew")
    arguments = parser.parse_args()
    names = arguments.names or list(SESSIONS)
    for name in names if not arguments.outcomes else ():
        record(name)
        print(f"recorded {name}", flush=True)
    for one in sessions():
        if one.name in names:
            with tempfile.TemporaryDirectory() as folder:
                one.unpack(Path(folder))
                keep(one._replace(outcome=outcome(one, Path(folder))))


if __name__ == "__main__":
    main()
