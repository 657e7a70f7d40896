"""Recordings that somebody made to hurt, and commands run under a watch on memory and time."""

from __future__ import annotations

import os
import random
import re
import struct
import subprocess
import sys
import zlib
from typing import NamedTuple

import zstandard
from mcap.opcode import Opcode

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import records
from gritd.estimator.recording.mcapfile import MAGIC
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.topics import TOPICS
from tests.scenarios.rig import ROOT, TESTBED, driven

T0 = 1_790_000_000_000_000_000  # [ns]

WATCHED = """
import re, resource, sys, time
bound = int(sys.argv[1])
if bound:
    resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
from gritd.tools.main import main
code = main(sys.argv[2:])
with open("/proc/self/status") as status:
    peak = int(re.search(r"VmHWM:\\s+(\\d+) kB", status.read())[1])
print(f"took {time.process_time():.2f} s {peak / 1024:.0f} MB", file=sys.stderr)
sys.exit(code)
"""


class Watched(NamedTuple):
    code: int
    out: str
    error: str  # what the command said on standard error
    seconds: float  # of processor time, Python's start included
    memory: float  # [MB] at most

    @property
    def one_line(self):
        """Whether it ended with one line that says why."""
        ours = self.error.startswith("gritd: ") and "internal error" not in self.error
        return self.code in (1, 2, 3) and ours and self.error.count("\n") == 1


def watched(*arguments, bound=0, **environment):
    """A command in a process of its own, its address space bounded [bytes] unless 0."""
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(bound), *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, timeout=600, check=False,
        env={**os.environ, **environment},
    )  # fmt: skip
    error, found, took = done.stderr.rpartition("took ")
    if not found:  # it died
        return Watched(done.returncode, done.stdout, done.stderr, float("nan"), float("nan"))
    seconds, memory = map(float, re.findall(r"[\d.]+", took))
    return Watched(done.returncode, done.stdout, error, seconds, memory)


def shifted(reading, by=T0):
    return reading._replace(stamp=reading.stamp + by, received=reading.received + by)


def honest(path, seconds=10.0, run=None, close=True):
    """A recording of raw readings, and its writer if it is not to be closed yet."""
    writer = RunWriter(path, TOPICS, TESTBED.text, run or RunInfo("run", 70.0))
    for reading in driven(seconds + 4.0, 1, skip=4.0):
        writer.reading(shifted(reading))
    if close:
        writer.close()
        return None
    writer.write_out()
    return writer


def bomb(path, chunks, size=30 << 20, noise=32_000):
    """Ten seconds of honest readings, then chunks of the last one again and again, each of which
    unpacks to almost a thousand times what it takes.
    """
    own = path.with_suffix(".own")
    writer = honest(own, close=False)
    names = ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt")
    values = (1, 1, 1.0, 1.0)
    again = b"".join(
        writer._encoders[f"/raw/{name}"](T0 + 10**10, (T0 + 10**10, value))
        for name, value in zip(names, values, strict=True)
    )
    text = random.Random(1).randbytes(noise).hex()
    log = writer._encoders["/log"](T0, (T0, 10, "", text, "", "", 0))
    definitions = b"".join(writer._file._preambles.values())
    writer.close()
    data = definitions + again * (size // len(again)) + log
    head = struct.pack("<QQQI", T0, T0, len(data), zlib.crc32(data))
    packed = zstandard.compress(data)
    assert len(data) < 1000 * len(packed)
    one = record(6, head + struct.pack("<I4sQ", 4, b"zstd", len(packed)) + packed)
    mcap(path, *chunks_of(own), *[one] * chunks)


def later(path, seconds):
    """Ten seconds, and one more reading of every channel so much later, a little before now."""
    writer = RunWriter(path, TOPICS, TESTBED.text, RunInfo("run", 70.0))
    readings = [shifted(r, T0 - round(seconds * 1e9)) for r in driven(14.0, 1, skip=4.0)]
    last = {reading.channel: shifted(reading, round(seconds * 1e9)) for reading in readings}
    for reading in (*readings, *last.values()):
        writer.reading(reading)
    writer.close()


def mcap(path, *pieces):
    """A file of these bytes, after a header that another writer might have made."""
    header = record(1, struct.pack("<I", 0) + struct.pack("<I", 1) + b"x")
    with open(path, "wb") as file:
        file.write(MAGIC + header)
        for piece in pieces:
            file.write(piece)


def record(opcode, body):
    return struct.pack("<BQ", opcode, len(body)) + body


def tiny_chunks(path, size):
    """So many bytes of chunks with one reading each."""
    one = path.with_suffix(".one")
    writer = RunWriter(one, (), TESTBED.text, RunInfo("run"))
    writer.reading(Reading(T0, "wheel_encoder", 1, T0))
    writer.close()
    (chunk,) = chunks_of(one)
    mcap(path, *[chunk] * (size // len(chunk)))


def chunks_of(path):
    """The chunk records of a file, without their indexes."""
    data = path.read_bytes()[len(MAGIC) : -len(MAGIC)]
    return [data[start - 9 : end] for opcode, start, end in records(data) if opcode == Opcode.CHUNK]
