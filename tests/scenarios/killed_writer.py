"""Writer threads in processes of their own, one after the other, each killed by whoever started it.

python -m tests.scenarios.killed_writer FOLDER logging|rotating|closing NUMBER
"""

from __future__ import annotations

import mmap
import os
import struct
import sys
import time
from pathlib import Path

from gritd.estimator.daemon.scheduling import real_time
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.cdr import TIME, Topic
from gritd.estimator.recording.writer import WriterThread

MARK = b"closing\n"
PART = Topic("/part", "gritd_msgs/msg/Part", (("stamp", TIME, "when"),))
LENGTHS = {"logging": 60.0, "rotating": 60.0, "closing": 0.3}  # [s] until it closes by itself


def main(folder: Path, kind: str, number: int) -> None:
    """Say the process of each writer, and wait for its end before the next one begins."""
    for name in range(number):
        with open(folder / f"{name}.put", "w+b") as shared:
            shared.truncate(16)
            child = os.fork()
            if not child:
                # what the loop has handed over, as the kernel remembers it
                write(folder / f"{name}.mcap", kind, mmap.mmap(shared.fileno(), 16))
        print(child, flush=True)
        os.waitpid(child, 0)


def write(path: Path, kind: str, put: mmap.mmap) -> None:
    """Five readings every 4 ms, a part every 0.1 s where it rotates; then close, and wait."""
    real_time()
    writer = WriterThread(path, [PART], "a: 1", RunInfo())
    writer.start()

    count, end = 0, time.monotonic() + LENGTHS[kind]
    while time.monotonic() < end:
        now = time.time_ns()
        if kind == "rotating" and count % 25 == 24:
            writer.begin_part("a: 1", (PART.name, now, (now,)))
        writer.put([Reading(now, "wheel_encoder", count, now)] * 5)
        put[:] = struct.pack("<qq", count + 1, now)
        count += 1
        time.sleep(0.004)

    os.write(1, MARK)
    writer.stop()
    time.sleep(60.0)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
