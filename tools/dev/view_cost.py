"""What `gritd view` costs the daemon beside it, in one run on wires: without a view, with one, with
streams, with browsers (where Chromium is installed), attacked, frozen, killed. Then the memory of a
view over an hour of reports sent faster.

python -m gritd.tools.dev.view_cost [--seconds 30] [--browsers 20] [--clients 1000] [--hours 1]
"""

from __future__ import annotations

import asyncio
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import numpy as np

from gritd.estimator.daemon.publish import line_of
from gritd.estimator.messages.readings import NS
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.child import Child, interruptible
from gritd.tools.cli.command import DONE, Parser
from gritd.tools.cli.progress import Progress
from gritd.tools.service.client import connected, reports
from gritd.tools.view.history import LONGEST, RATE

READY = 120.0  # [s] the longest that a process may take to start
SETTLED = 5.0  # [s] of a stretch before it counts
SPARE = 60.0  # [s] that the testbed plays longer
STARTING = 1.0  # [s] a browser takes to show the page
CHROMIUM = shutil.which("chromium")
OPTIONS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--remote-debugging-port=0",
)
FASTER = 25.0  # times that an hour of reports is sent faster
HEAD = "GET {} HTTP/1.1\r\nHost: {}\r\n"
KINDS = (
    "",  # idle
    HEAD.format("/live", "localhost") + "\r\n",  # and never reads
    HEAD.format("/stretch?seconds=3600&points=4000", "localhost") + "\r\n",  # and never reads
    HEAD.format("/", "localhost") + "X: " + "x" * 60_000,  # a head without end
    HEAD.format("/", "elsewhere.example") + "\r\n",  # a foreign host
    "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 900000000\r\n\r\n" + "x" * 60_000,
)


class CostSpan(NamedTuple):
    """What went on from `begin` to `end` [ns]; processor time [s] of both, memory of the view
    [bytes].
    """

    name: str
    begin: int
    end: int
    daemon: float
    view: float | None
    memory: float | None


def main(argv: Sequence[str] | None = None) -> int:
    """Print two tables."""
    parser = Parser(prog="python -m gritd.tools.dev.view_cost", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="of each stretch; default 30")
    parser.add_argument(
        "--browsers", type=int, default=20, help="streams, and browsers; default 20"
    )
    parser.add_argument("--clients", type=int, default=1000, help="that attack; default 1000")
    parser.add_argument("--hours", type=float, default=1.0, help="of reports; default 1, 0: none")

    arguments = parser.parse_args(argv)
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    with tempfile.TemporaryDirectory() as folder, interruptible() as stop:
        report = on_wires(Path(folder), arguments, stop)
        if arguments.hours:
            remembered(Path(folder), report, arguments.hours, stop)
    return DONE


# --- beside the daemon ---


def on_wires(folder: Path, arguments: Namespace, stop: StopRequest) -> dict[str, Any]:
    """One run with its stretches; a report of the daemon."""
    seconds = 8 * (arguments.seconds + SETTLED) + SPARE
    options = ["--seconds", str(seconds), "--folder", str(folder), "--wait"]

    with Child(stop, "testbed", "gritd.tools.testbed.testbed", *options) as testbed:
        config = testbed.wait_for("configuration ", READY).split(" ", 1)[1]
        with Child(stop, "daemon", "gritd", "run", "--config", config) as daemon:
            for _ in range(2):
                daemon.wait_for("device ", READY)
            testbed.tell("play")
            stretches = list(_stretches(folder, daemon, arguments, stop))
            with connected(str(folder / "gritd.sock")) as connection:
                report = next(iter(reports(connection)))
            daemon.stop()

    recording = read(next(folder.glob("*.mcap")))
    _print(stretches, recording)
    command = (sys.executable, "-m", "gritd", "replay", str(recording.path), "--verify")
    subprocess.run(command, check=True)
    return report


def _stretches(
    folder: Path, daemon: Child, arguments: Namespace, stop: StopRequest
) -> Iterator[CostSpan]:
    browsers, clients = arguments.browsers, arguments.clients

    def during(name: str, view: Child | None, *doing: Callable[[], Awaitable[None]]) -> CostSpan:
        return asyncio.run(_during(name, daemon, view, arguments.seconds, doing))

    yield during("no view", None)
    with _viewing(folder / "gritd.sock", stop) as (view, port):

        async def following() -> None:
            await asyncio.gather(*[_followed(port) for _ in range(browsers)])

        async def attacking() -> None:
            await asyncio.gather(*[_attacked(port, number) for number in range(clients)])

        yield during("view, no browser", view)
        yield during("1 stream", view, lambda: _followed(port))
        yield during(f"{browsers} streams", view, following)
        if CHROMIUM:
            with _looking(port, browsers, folder):
                yield during(f"{browsers} browsers on this machine", view)
        yield during(f"{clients} clients attack", view, attacking)
        os.kill(view.pid, signal.SIGSTOP)
        yield during("view frozen", view)
        os.kill(view.pid, signal.SIGKILL)
    yield during("view killed", None)


@contextmanager
def _viewing(path: Path, stop: StopRequest) -> Iterator[tuple[Child, int]]:
    view = Child(stop, "view", "gritd", "view", "--port", "0", "--socket", str(path))
    try:
        address = view.wait_for("view ", READY)
        yield view, int(address.rstrip("/").rpartition(":")[2])
    finally:
        with suppress(Exception):  # killed
            view.stop()


@contextmanager
def _looking(port: int, count: int, folder: Path) -> Iterator[None]:
    """Browsers that show the page, at the lowest priority: they belong on other computers."""
    address = f"http://127.0.0.1:{port}/"
    started = [
        subprocess.Popen(
            ("nice", "-n", "19", str(CHROMIUM), *OPTIONS, f"--user-data-dir={folder}/{n}", address),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for n in range(count)
    ]
    try:
        time.sleep(STARTING * count)
        yield
    finally:
        for each in started:
            each.terminate()
        for each in started:
            each.wait()


async def _during(
    name: str,
    daemon: Child,
    view: Child | None,
    seconds: float,
    doing: Sequence[Callable[[], Awaitable[None]]],
) -> CostSpan:
    tasks = [asyncio.ensure_future(each()) for each in doing]
    await asyncio.sleep(SETTLED)
    begin, before = time.time_ns(), [_used(child.pid) for child in (daemon, view) if child]
    await asyncio.sleep(seconds)
    end, after = time.time_ns(), [_used(child.pid) for child in (daemon, view) if child]

    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    while daemon.line(0.0):  # what it says goes nowhere
        pass

    used = [a - b for a, b in zip(after, before, strict=True)]
    memory = _memory(view.pid) if view else None
    return CostSpan(name, begin, end, used[0], used[1] if view else None, memory)


async def _followed(port: int) -> None:
    """A browser that reads the stream."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(KINDS[1].encode())
        while await reader.read(1 << 16):
            pass
    finally:
        writer.close()


async def _attacked(port: int, number: int) -> None:
    """A client that comes again and again."""
    while True:
        with suppress(OSError):
            _, writer = await asyncio.open_connection("127.0.0.1", port, limit=1)
            try:
                writer.write(KINDS[number % len(KINDS)].encode())
                await asyncio.sleep(2.0)
            finally:
                writer.close()
        await asyncio.sleep(0.5)


def _used(pid: int) -> float:
    """Processor time [s] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _memory(pid: int) -> float:
    """Resident memory [bytes] of a process."""
    pages = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * float(os.sysconf("SC_PAGESIZE"))


def _print(stretches: Sequence[CostSpan], recording: Recording) -> None:
    loop = recording.arrays("/loop")
    print(f"load average {os.getloadavg()[1]:.1f} on {os.cpu_count()} cores; {recording.path.name}")
    lost = loop[["dropped", "log_dropped"]][-1].tolist()
    print(f"readings that the queue dropped: {lost[0]}; messages that the log dropped: {lost[1]}\n")
    print("| | daemon | view | its memory | loop late by (half, 99 %, 99.9 %) | ticks missed |")
    print("|---|--:|--:|--:|---|--:|")
    for each in stretches:
        rows = loop[(loop["stamp"] >= each.begin) & (loop["stamp"] < each.end)]
        late = ", ".join(
            f"{v * 1e3:.2f}" for v in np.quantile(rows["lateness"], (0.5, 0.99, 0.999))
        )
        seconds = (each.end - each.begin) / NS
        daemon = f"{each.daemon / seconds:.1%}"
        view = "" if each.view is None else f"{each.view / seconds:.1%}"
        memory = "" if each.memory is None else f"{each.memory / 1e6:.0f} MB"
        missed = int(rows["missed"][-1]) - int(rows["missed"][0])
        print(f"| {each.name} | {daemon} | {view} | {memory} | {late} ms | {missed} |")


# --- memory ---


def remembered(folder: Path, report: dict[str, Any], hours: float, stop: StopRequest) -> None:
    """The memory of a view over hours of reports of a made-up daemon, with a stream and a request
    for the whole hour now and then.
    """
    path, count = folder / "faster.sock", round(hours * LONGEST * RATE)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen(1)
        with _viewing(path, stop) as (view, port), Progress("memory", count) as progress:
            connection, _ = listener.accept()
            follower = Thread(target=_reading, args=(port,), daemon=True)
            follower.start()
            print(f"\n| reports of | memory of the view |\n|---|--:|\n| 0 min | {_mb(view.pid)} |")
            for number in range(count):
                _sent(connection, report, number)
                progress.advance()
                if (number + 1) % (count // 6) == 0:
                    _asked(port)
                    print(f"| {(number + 1) / RATE / 60:.0f} min | {_mb(view.pid)} |")


def _sent(connection: socket.socket, report: dict[str, Any], number: int) -> None:
    passed = number / RATE
    tick = report["tick"]
    moved = {
        "evaluated": tick["evaluated"] + round(passed * NS),
        "sequence": tick["sequence"] + number,
        "cohesion": tick["cohesion"] * (1.0 + 0.1 * np.sin(passed / 60.0)),
    }
    connection.sendall(line_of({**report, "tick": {**tick, **moved}}))
    time.sleep(1.0 / (RATE * FASTER))


def _reading(port: int) -> None:
    with suppress(OSError), socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(KINDS[1].encode())
        while client.recv(1 << 16):
            pass


def _asked(port: int) -> None:
    """The whole hour."""
    with socket.create_connection(("127.0.0.1", port)) as client:
        client.sendall(KINDS[2].replace("\r\n\r\n", "\r\nConnection: close\r\n\r\n").encode())
        while client.recv(1 << 16):
            pass


def _mb(pid: int) -> str:
    return f"{_memory(pid) / 1e6:.0f} MB"


if __name__ == "__main__":
    raise SystemExit(main())
