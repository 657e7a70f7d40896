"""`gritd view` as a process."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.request import Request, urlopen

PATIENCE = 180.0  # [s] with a computer that others keep busy


@contextmanager
def viewing(*options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process, and the address it serves."""
    command = [sys.executable, "-m", "gritd", "view", "--port", "0", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().split()[1]
    finally:
        process.kill()
        process.wait()


def place(address: str) -> tuple[str, int]:
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    return host, int(port)


def asks(address: str, path: str = "") -> int:
    with urlopen(Request(address + path), timeout=PATIENCE) as answer:
        return int(answer.status)


def answers(address: str) -> bool:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            return asks(address) == 200
        except OSError:
            time.sleep(0.2)
    return False
