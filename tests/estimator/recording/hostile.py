"""Files that claim to be recordings and would cost a reader memory or time, and what they cost."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import zstandard

from gritd.estimator.recording.mcapfile import MAGIC


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def chunk(data: bytes, size: int, compression: str = "zstd", stored: int | None = None) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return record(6, head + struct.pack("<Q", len(data) if stored is None else stored) + data)


HEADER = MAGIC + record(1, text("") + text("x"))
HUGE = 2**64 - 1
ZEROS = zstandard.compress(bytes(20 << 20))
SMALLEST = record(5, bytes(22)) * 500_000  # messages of channel 0, which does not exist
UNSIZED = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(1 << 28))
HOSTILE = {
    "not mcap": lambda: b"\x7fELF" + bytes(100),
    "empty": lambda: b"",
    "magic only": lambda: MAGIC,
    "huge record": lambda: HEADER + record(6, b"", HUGE),
    "huge stored": lambda: HEADER + chunk(b"x", 10, stored=HUGE),
    "huge size": lambda: HEADER + chunk(b"x", HUGE),
    "bomb": lambda: HEADER + chunk(ZEROS, 20 << 20) * 50,
    "bomb within the ratio": lambda: HEADER + chunk(ZEROS + os.urandom(40_000), 20 << 20) * 50,
    "bomb that understates": lambda: HEADER + chunk(ZEROS, 1000) * 500,
    "bomb without a size": lambda: HEADER + chunk(UNSIZED, 1000),
    "unknown compression": lambda: HEADER + chunk(b"x" * 100, 100, "brotli"),
    "endless small messages": lambda: (
        HEADER + chunk(zstandard.compress(SMALLEST) + bytes(1 << 15), len(SMALLEST)) * 20
    ),
    "huge schema": lambda: (
        HEADER + record(3, struct.pack("<H", 1) + text("a") + text("ros2msg") + b"\xff" * 4)
    ),
    "huge metadata": lambda: HEADER + record(12, text("gritd.run") + b"\xff\xff\xff\xff"),
    "all chunk heads": lambda: HEADER + b"\x06" * (30 << 20),
    "heads within heads": lambda: HEADER + chunk(b"", 64, stored=0)[:-8] * 100_000,
    "empty chunks": lambda: HEADER + chunk(b"", 0, "") * 20_000,
    "footer to nowhere": lambda: HEADER + record(2, struct.pack("<QQI", HUGE, HUGE, 0)) + MAGIC,
    "footer to itself": lambda: HEADER + record(2, struct.pack("<QQI", len(HEADER), 0, 0)) + MAGIC,
}

PROBE = r"""
import re, resource, sys, time
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import read
try:
    recording = read(sys.argv[1])
    said = f"{sum(1 for _ in recording.messages())} messages, {recording.damage[:1]}"
except RecordingError as error:
    said = f"RecordingError: {error}"
# ru_maxrss would count what the parent held when it forked
with open("/proc/self/status") as status:
    peak = int(re.search(r"VmHWM:\s+(\d+) kB", status.read())[1])
print(f"{time.process_time():.2f} s, {peak / 1024:.0f} MB: {said}")
"""


def probe(path: Path) -> tuple[float, float, str]:
    """Seconds of processor time, peak MB and what was said, in a process of its own whose
    address space is bounded.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(__file__).parents[3]),
        "OPENBLAS_NUM_THREADS": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", PROBE, str(path)],
        capture_output=True,
        text=True,
        timeout=600,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    numbers, said = done.stdout.split(": ", 1)
    seconds, _, memory, _ = numbers.replace(",", "").split()
    return float(seconds), float(memory), said
