"""The real daemon process on real wires: pseudo-terminals and a loopback CAN bus, driven by the
simulated testbed.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from threading import Event, Thread

import yaml

from gritd.config import packaged
from gritd.drivers.wire import CanWire, SerialWire
from gritd.estimator.config import configuration as config
from gritd.estimator.config.yamltree import dumped
from gritd.tools.service.client import connected, reports
from gritd.tools.testbed import rig_config
from gritd.tools.testbed.testbed import experiment, in_transit, play
from gritd.tools.testbed.wires import ConnectedDevices, has_multicast, messages, slcan_line
from tests.drivers.rig import Plug

ROOT = Path(__file__).parents[2]
TESTBED = config.load(packaged())
BUS = "udp_multicast" if has_multicast() else "slcan"
BECOMING = """
import os, encodings.idna, encodings.utf_8_sig, can.interfaces.slcan, can.interfaces.udp_multicast
import gritd.tools.commands.run, gritd.tools.service.serve
import gritd.tools.main
from gritd.drivers.build import build_readers
from gritd.estimator.config.configuration import load
build_readers(load({config!r}).settings, lambda: 0, None)
os.setgroups([]); os.setgid({user}); os.setuid({user})
"""
LIMIT = 120.0  # [s] ends a scenario that has failed
WIRES = "daemon on wires"


@lru_cache(maxsize=4)
def driven(seconds, seed, skip=0.0):
    """Readings of a simulated run, stamps and arrivals from zero [ns]; `skip` [s] of them left out
    at the start.
    """
    readings = in_transit(experiment(TESTBED, seconds, "linear", seed).run.readings, seed)
    start = int(skip * 1e9)
    return [
        r._replace(stamp=r.stamp - start, received=r.received - start)
        for r in readings
        if r.received >= start
    ]


class PluggedDevice:
    """A serial device behind a fixed path, that can be unplugged; a FarEnd of
    gritd.tools.testbed.wires.
    """

    def __init__(self, device, folder):
        self.plug = Plug(folder / device.name)
        self.device = replace(device, port=str(self.plug.path))
        self.wire = SerialWire(device)
        self.lost = 0

    def send(self, key, values, device_us):
        try:
            self.plug.send(self.wire.encode(key, values, device_us))
        except OSError:
            self.lost += 1

    def close(self):
        self.plug.close()


class PluggedBus:
    """A serial CAN adapter (slcan) that can be unplugged."""

    def __init__(self, device, folder):
        self.plug = Plug(folder / device.name)
        self.device = replace(device, interface="slcan", channel=str(self.plug.path), options={})
        self.wire = CanWire(device)
        self.lost = 0

    def send(self, key, values, device_us):
        try:
            with suppress(BlockingIOError):
                os.read(self.plug._master, 4096)  # what the daemon tells the adapter
            for message in messages(self.wire, key, values, device_us):
                self.plug.send(slcan_line(message))
        except OSError:
            self.lost += 1

    def close(self):
        self.plug.close()


class Wires(ConnectedDevices):
    """The testbed's wires with the encoders on a plug, the configuration for a daemon on them, and
    a player.
    """

    def __init__(self, folder, bus=BUS, **changes):
        super().__init__(TESTBED.settings, bus)
        self._ends["encoders"].close()
        self.encoders = self._ends["encoders"] = PluggedDevice(
            TESTBED.settings.devices["encoders"], folder
        )
        if bus == "slcan":
            self._ends["bus"].close()
            self._ends["bus"] = PluggedBus(TESTBED.settings.devices["bus"], folder)
        self.bus = self._ends["bus"]
        self.folder = folder
        self.config = rig_config.write(TESTBED, self.devices, "linear", folder)
        self.configure(**changes)
        self._stop = Event()
        self._player = None

    def configure(self, **sections):
        """Change keys of the configuration file: section=dict(key=value)."""
        document = yaml.safe_load(self.config.read_text())
        for section, values in sections.items():
            document[section].update(values)
        self.config.write_text(dumped(document))

    def play(self, readings):
        """Send the readings in real time, from another thread."""
        self._player = Thread(target=play, args=(readings, self, self._stop.is_set), daemon=True)
        self._player.start()

    def finish(self):
        """Wait for the end of what is played."""
        self._player.join(LIMIT)

    def __exit__(self, *error):
        self._stop.set()
        if self._player is not None:
            self._player.join(LIMIT)
        super().__exit__(*error)


class Manager:
    """The service manager's socket, always read: it holds only a few messages, and what does not
    fit is lost.
    """

    def __init__(self, path):
        self.path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(path))
        os.chmod(path, 0o777)
        self._heard, self._seen = [], 0
        self._thread = Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self):
        while text := self._socket.recv(65536).decode():
            self._heard.append((time.monotonic(), text))

    def after(self, words):
        """[when] the next message with these words came, of those not yet asked for; [] if none
        has.
        """
        for number in range(self._seen, len(self._heard)):
            if words in self._heard[number][1]:
                self._seen = number + 1
                return [self._heard[number][0]]
        return []

    def count(self, words):
        """Of the messages sent until now, how many have these words."""
        mark = f"mark {len(self._heard)}"
        self._send(mark)
        until(lambda: any(text == mark for _, text in list(self._heard)))
        return sum(words in text for _, text in list(self._heard))

    def _send(self, text):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.sendto(text.encode(), str(self.path))

    def close(self):
        self._send("")
        self._thread.join(LIMIT)
        self._socket.close()


class DaemonProcess:
    """`gritd run` as a service manager sees it: its messages, its signals, its exit.

    prelude: Python that is run in the daemon's process before the command, to bring a fault about
        from inside.
    user: the user it becomes once Python has loaded the code, which may lie where only its owner
        can read it.
    """

    def __init__(self, config, *arguments, prelude="", watchdog=0.0, user=None):
        self._box = tempfile.TemporaryDirectory(prefix="gritd")
        self.folder = config.parent
        self.socket = str(Path(self._box.name) / "gritd.sock")
        self._manager = Manager(Path(self._box.name) / "notify")
        os.chmod(self._box.name, 0o777)
        environment = {
            **os.environ,
            "NOTIFY_SOCKET": str(self._manager.path),
            "PYTHONPATH": str(ROOT),
        }
        if watchdog:
            environment["WATCHDOG_USEC"] = str(int(watchdog * 1e6))
        becoming = "" if user is None else BECOMING.format(user=user, config=str(config))
        code = f"{becoming}\n{prelude}\nimport sys, gritd.tools.commands.run, gritd.tools.main\n"
        code += "import gritd.tools.service.serve\nprint('loaded', flush=True)\n"
        code += "sys.exit(gritd.tools.main.main(sys.argv[1:]))"
        command = ["--config", str(config), "--socket", self.socket, "--status", "0"]
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, "run", *command, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
            cwd=ROOT,
        )
        self.said = []
        self._listener = Thread(target=self._listen, daemon=True)
        self._listener.start()
        self.pid = self.process.pid

    def _listen(self):
        for line in self.process.stdout:
            self.said.append((time.monotonic(), line.rstrip()))

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if self.process.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGCONT)
            self.process.kill()
        self.process.wait()
        self._listener.join(LIMIT)
        self._manager.close()
        self._box.cleanup()

    def ready(self):
        """Wait for READY=1 and for both devices to be open."""
        self.notified("READY=1")
        self.until(lambda: len(self.lines(" OPEN")) >= 2, "devices did not open")
        return self

    def until(self, condition, complaint, limit=LIMIT):
        """Wait for the condition, which a daemon that has ended cannot bring about any more."""

        def settled():
            if self.process.poll() is not None:
                self._listener.join(LIMIT)
                assert condition(), f"{complaint}, and has ended: {self.text}"
            return condition()

        until(settled, lambda: f"{complaint}: {self.text}", limit)

    def notified(self, message, limit=LIMIT):
        """Wait for the next message to the service manager that contains this; when it came."""
        found = []
        self.until(
            lambda: found or found.extend(self._manager.after(message)) or found,
            f"no {message}",
            limit,
        )
        return found[0]

    def strokes(self, seconds):
        """How often the watchdog is stroked in a time from now."""
        before = self._manager.count("WATCHDOG=1")
        time.sleep(seconds)
        return self._manager.count("WATCHDOG=1") - before

    def datagrams(self, port):
        """Of the daemon's socket on a UDP port: bytes that wait in it, datagrams that the kernel
        threw away.
        """
        held = {
            os.path.basename(name) for name in map(link_of, Path(f"/proc/{self.pid}/fd").iterdir())
        }
        for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
            words = line.split()
            if int(words[1].partition(":")[2], 16) == port and f"socket:[{words[9]}]" in held:
                return int(words[4].partition(":")[2], 16), int(words[12])
        raise AssertionError(f"no socket on port {port}")

    @property
    def text(self):
        return "\n".join(line for _, line in self.said)

    def lines(self, words):
        return [(when, line) for when, line in list(self.said) if words in line]

    def heard(self, words, count=1, limit=LIMIT):
        """Wait until it has said this so often; when it did for that time."""
        self.until(lambda: len(self.lines(words)) >= count, f"did not say {words!r}", limit)
        return self.lines(words)[count - 1][0]

    def status(self):
        with connected(self.socket) as connection:
            return next(reports(connection))

    def wait_status(self, condition, limit=LIMIT):
        """Poll the status until it fulfils the condition; the report that did."""
        with connected(self.socket) as connection:
            end = time.monotonic() + limit
            for report in reports(connection):
                if condition(report):
                    return report
                assert time.monotonic() < end, f"status never as expected: {report}"

    def signal(self, number):
        os.kill(self.pid, number)
        return time.monotonic()

    def descriptors(self):
        """How many are open for long: the fewest of some looks, for a file that is being synced
        counts twice.
        """
        return min(
            len(os.listdir(f"/proc/{self.pid}/fd")) for _ in range(20) if not time.sleep(0.02)
        )

    def threads(self):
        return len(os.listdir(f"/proc/{self.pid}/task"))

    def exit_code(self, limit=LIMIT):
        code = self.process.wait(limit)
        self._listener.join(LIMIT)
        return code

    def stop(self):
        """SIGTERM; how long it took [s]. Asserts exit code 0."""
        start = self.signal(signal.SIGTERM)
        assert self.exit_code() == 0, self.text
        return time.monotonic() - start

    def path(self):
        """The first part of its recording."""
        (line,) = [line for _, line in self.said if line.startswith("logging to ")][:1]
        return Path(line.removeprefix("logging to "))

    def account(self):
        """accepted, written, dropped and queued of its last line."""
        (line,) = [line for _, line in self.said if line.startswith("log closed")]
        return [int(word) for word in line.replace(";", " ").split() if word.isdigit()][:4]


def link_of(path):
    """What a descriptor is, '' if it has just been closed."""
    try:
        return os.readlink(path)
    except OSError:
        return ""


def until(condition, complaint=lambda: "waited in vain", limit=LIMIT):
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, complaint()
        time.sleep(0.002)


@contextmanager
def service(folder, readings=None, prelude="", watchdog=0.0, **changes):
    """Wires and a ready daemon on them, playing the readings."""
    with (
        Wires(folder, **changes) as wires,
        DaemonProcess(wires.config, prelude=prelude, watchdog=watchdog) as daemon,
    ):
        daemon.ready()
        if readings is not None:
            wires.play(readings)
        yield wires, daemon
