"""The writer thread: nothing waits for it, everything is counted, and the disk may fail."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import McapFile, RecordingError
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.syncer import Syncer
from gritd.estimator.recording.writer import WriterStatus, WriterThread
from tests.estimator.recording.samples import MIXED, T0, mixed_values

REPOSITORY = Path(__file__).parents[3]


def reading(i: int) -> Reading:
    return Reading(T0 + i, "wheel_encoder", i, T0 + i)


def counts(path: Path) -> list[int]:
    """The encoder counts of a run, all parts in order."""
    return [
        int(c) for part in parts(path) for c in read(part).arrays("/raw/wheel_encoder")["count"]
    ]


def wait_for(condition: Callable[[], object], limit: float = 120.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


def exact(status: WriterStatus) -> bool:
    return status.accepted == status.written + status.dropped + status.queued


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[WriterThread]:
    thread = WriterThread(
        tmp_path / "run.mcap", [MIXED], "a: 1\n", RunInfo("r"), flush_interval=0.02, retry=0.05
    )
    thread.start()
    yield thread
    thread.stop()


def test_order_is_readings_then_the_tick_that_consumed_them(
    writer: WriterThread, tmp_path: Path
) -> None:
    for tick in range(50):
        writer.put(
            [reading(3 * tick + k) for k in range(3)], [("/mixed", T0 + tick, mixed_values(tick))]
        )
    status = writer.stop()
    assert status == WriterStatus("closed", "", 200, 200, 0, 0, (tmp_path / "run.mcap",))
    recording = read(tmp_path / "run.mcap")
    assert recording.complete
    assert [topic[1] for topic, _, _ in recording.messages()] == ["r", "r", "r", "m"] * 50
    assert recording.arrays("/mixed")["stamp"].tolist() == [T0 + tick for tick in range(50)]


def test_what_is_flushed_is_readable_while_the_run_goes_on(
    writer: WriterThread, tmp_path: Path
) -> None:
    writer.put([reading(i) for i in range(100)])
    wait_for(lambda: writer.status().written == 100)
    recording = read(tmp_path / "run.mcap")
    assert (
        recording.counts.total() == 100
        and not recording.closed
        and recording.config_yaml == "a: 1\n"
    )


def test_counters_are_exact_while_several_threads_put(writer: WriterThread, tmp_path: Path) -> None:
    def feed(start: int) -> None:
        for i in range(200):
            writer.put([reading(start + i)])

    threads = [threading.Thread(target=feed, args=(1000 * k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        assert exact(writer.status())
    status = writer.stop()
    assert (status.accepted, status.written, status.dropped, status.queued) == (800, 800, 0, 0)
    assert sorted(counts(tmp_path / "run.mcap")) == sorted(
        1000 * k + i for k in range(4) for i in range(200)
    )


def test_a_queue_that_overflows_drops_its_oldest_counts_them_and_begins_a_new_file(
    tmp_path: Path,
) -> None:
    """The writer is held (not yet started) while messages pour in."""
    thread = WriterThread(
        tmp_path / "run.mcap", [], "a: 1\n", RunInfo("r"), flush_interval=0.02, capacity=100
    )
    thread.put([reading(i) for i in range(130)])
    status = thread.status()
    assert (status.accepted, status.written, status.dropped, status.queued) == (130, 0, 30, 100)
    thread.start()
    final = thread.stop()
    assert (final.accepted, final.written, final.dropped, final.queued) == (130, 100, 30, 0)
    assert final.files == (tmp_path / "run.mcap", tmp_path / "run.1.mcap")
    assert counts(tmp_path / "run.mcap") == list(range(30, 130))
    assert read(tmp_path / "run.1.mcap").run == RunInfo("r", part=1, lost_before=30)
    assert all(read(part).complete and read(part).config_yaml == "a: 1\n" for part in final.files)


def test_a_message_that_fits_no_topic_is_dropped_and_said(
    writer: WriterThread, tmp_path: Path
) -> None:
    writer.put([reading(1)], [("/mixed", T0, (1, 2)), ("/none", T0, ())])
    status = writer.stop()
    assert (status.accepted, status.written, status.dropped, status.queued) == (3, 1, 2, 0)
    assert "/none: not a topic" in status.error
    assert counts(tmp_path / "run.mcap") == [1]


UNFIT = [
    ("/mixed", T0, mixed_values(0)[:-1]),
    ("/mixed", -1, mixed_values(0)),
    ("/mixed", T0, (1 << 62, *mixed_values(0)[1:])),
    ("/mixed", T0, tuple(10**400 for _ in mixed_values(0))),
    ("/mixed", T0, tuple(None for _ in mixed_values(0))),
    ("/mixed", T0, tuple("\ud800" for _ in mixed_values(0))),
    ("/log", T0, 5),
    (5, T0, ()),
]


@pytest.mark.parametrize("message", UNFIT)
def test_a_message_that_cannot_be_written_is_lost_alone(
    writer: WriterThread, tmp_path: Path, message: tuple[Any, int, Any]
) -> None:
    writer.put([reading(1)])
    writer.put([reading(2)], [message, ("/mixed", T0, mixed_values(0))])
    writer.put([Reading(1 << 62, "wheel_encoder", 1, T0), reading(3)])
    status = writer.stop()
    assert (status.accepted, status.written, status.dropped, status.unfit) == (6, 4, 2, 2)
    assert status.state == "closed" and "/raw/wheel_encoder" in status.error
    assert counts(tmp_path / "run.mcap") == [1, 2, 3] and exact(status)
    assert read(tmp_path / "run.mcap").complete


def test_a_writer_that_is_stopped_before_it_is_started_writes_what_it_has(tmp_path: Path) -> None:
    thread = WriterThread(tmp_path / "run.mcap", [], "", RunInfo())
    thread.put([reading(1)])
    assert thread.stop().state == "closed" and counts(tmp_path / "run.mcap") == [1]


# ---- a disk that fails ---------------------------------------------------------------------------


class FailingDisk:
    """Simulates a disk by patching the file's write: `number` is the errno it raises, or None
    while it works. A failing write first stores half of the bytes, as a full disk does.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.number: int | None = None
        append = McapFile._append

        def failing(file: McapFile, data: bytes) -> None:
            if self.number is None:
                return append(file, data)
            file._file.write(data[: len(data) // 2])
            file._rewind()
            raise RecordingError(
                f"{file.path}: cannot write: {os.strerror(self.number)}", self.number
            )

        monkeypatch.setattr(McapFile, "_append", failing)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> FailingDisk:
    return FailingDisk(monkeypatch)


def test_a_full_disk_is_waited_out_without_a_gap(
    writer: WriterThread, disk: FailingDisk, tmp_path: Path
) -> None:
    writer.put([reading(i) for i in range(10)])
    wait_for(lambda: writer.status().written == 10)
    disk.number = errno.ENOSPC
    writer.put([reading(i) for i in range(10, 20)])
    wait_for(lambda: writer.status().state == "degraded")
    status = writer.status()
    assert "run.mcap: cannot write: No space left on device" in status.error and exact(status)
    assert counts(tmp_path / "run.mcap") == list(range(10))  # still a valid prefix
    writer.put([reading(i) for i in range(20, 30)])
    disk.number = None
    wait_for(lambda: writer.status().state == "writing" and writer.status().queued == 0)
    final = writer.stop()
    assert (final.written, final.dropped, final.files) == (30, 0, (tmp_path / "run.mcap",))
    assert counts(tmp_path / "run.mcap") == list(range(30)) and read(tmp_path / "run.mcap").complete


def test_a_full_disk_that_outlasts_the_queue_goes_on_in_a_new_file(
    disk: FailingDisk, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    thread = WriterThread(
        path, [], "a: 1\n", RunInfo("r"), flush_interval=0.02, retry=0.05, capacity=50
    )
    thread.start()
    thread.put([reading(i) for i in range(10)])
    wait_for(lambda: thread.status().written == 10)
    disk.number = errno.ENOSPC
    thread.put([reading(i) for i in range(10, 20)])
    wait_for(lambda: thread.status().state == "degraded")
    for start in range(20, 200, 10):
        thread.put([reading(i) for i in range(start, start + 10)])
        assert exact(thread.status())
    disk.number = None
    wait_for(lambda: thread.status().state == "writing" and thread.status().queued == 0)
    final = thread.stop()
    assert final.files == (path, tmp_path / "run.1.mcap")
    assert (final.accepted, final.written, final.dropped) == (200, 70, 130)
    assert counts(path) == [*range(20), *range(150, 200)]
    assert read(tmp_path / "run.1.mcap").run.lost_before == 130
    assert all(read(part).complete for part in final.files)


def test_a_disk_with_errors_goes_on_in_a_new_file_without_a_gap(
    writer: WriterThread, disk: FailingDisk, tmp_path: Path
) -> None:
    writer.put([reading(i) for i in range(10)])
    wait_for(lambda: writer.status().written == 10)
    disk.number = errno.EIO
    writer.put([reading(i) for i in range(10, 20)])
    wait_for(lambda: writer.status().state == "degraded")
    assert "Input/output error" in writer.status().error
    disk.number = None
    wait_for(lambda: writer.status().written == 20)
    final = writer.stop()
    assert [p.name for p in final.files] == ["run.mcap", "run.1.mcap"] and final.dropped == 0
    assert counts(tmp_path / "run.mcap") == list(range(20))
    assert read(tmp_path / "run.1.mcap").run.lost_before == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "run.1.mcap",
        "run.mcap",
    ]  # nothing left of failed attempts


def test_a_failed_sync_is_said(writer: WriterThread, monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulated by patching fdatasync: the kernel reports a lost write there, and only there."""

    def failing(_: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr("gritd.estimator.recording.syncer.sync", failing)
    writer.put([reading(1)])
    wait_for(lambda: "cannot sync: Input/output error" in writer.status().error)
    monkeypatch.undo()
    wait_for(lambda: writer.status().state == "writing")


def test_what_is_asked_for_while_the_medium_is_busy_is_synced_before_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last batch and the index come while an earlier sync is under way: the end waits for
    them too.
    """
    synced: list[int] = []
    begun, go = threading.Event(), threading.Event()

    def slow(file: int) -> None:
        begun.set()
        go.wait()
        synced.append(os.fstat(file).st_ino)

    monkeypatch.setattr("gritd.estimator.recording.syncer.sync", slow)
    syncer = Syncer()
    syncer.start()
    with (tmp_path / "a").open("wb") as first, (tmp_path / "b").open("wb") as second:
        syncer.request(first.fileno())
        begun.wait()
        syncer.request(second.fileno())
        assert not syncer.stop(0.05) and syncer.waiting() > 0.0
        go.set()
        assert syncer.stop(10.0) and syncer.waiting() == 0.0
        assert synced == [os.fstat(file.fileno()).st_ino for file in (first, second)]


def test_a_disk_that_fails_to_the_end_costs_what_it_costs_and_is_counted(
    disk: FailingDisk, tmp_path: Path
) -> None:
    thread = WriterThread(tmp_path / "run.mcap", [], "", RunInfo(), flush_interval=0.02, retry=0.05)
    thread.start()
    thread.put([reading(i) for i in range(10)])
    wait_for(lambda: thread.status().written == 10)
    disk.number = errno.ENOSPC
    thread.put([reading(i) for i in range(10, 25)])
    final = thread.stop()
    assert (final.accepted, final.written, final.dropped, final.queued) == (25, 10, 15, 0)
    assert final.state == "degraded" and "No space left" in final.error
    assert (
        counts(tmp_path / "run.mcap") == list(range(10)) and not read(tmp_path / "run.mcap").closed
    )


TMPFS = """
import os, sys, time
from pathlib import Path
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.writer import WriterThread
folder = Path(sys.argv[1])
if os.system(f"mount -t tmpfs -o size=256k tmpfs {folder}"):
    sys.exit(77)
thread = WriterThread(
    folder / "run.mcap", [], "a: 1", RunInfo("r"),
    flush_interval=0.02, retry=0.2, compression="none",
)
thread.start()
ballast, i, states = folder / "ballast", 0, set()
def put(n):
    global i
    thread.put([Reading(10**18 + k, "wheel_encoder", k, 10**18 + k) for k in range(i, i + n)])
    i += n
put(100); time.sleep(0.1)
try:
    ballast.write_bytes(bytes(1 << 20))
except OSError:
    pass
put(2000)
while thread.status().state != "degraded":
    time.sleep(0.01)
print(thread.status().error)
ballast.unlink()
freed = time.monotonic()
while thread.status().state != "writing":
    time.sleep(0.01)
print(f"back after {time.monotonic() - freed:.2f} s")
final = thread.stop()
from gritd.estimator.recording.salvage import read
recording = read(folder / "run.mcap")
counts = recording.arrays("/raw/wheel_encoder")["count"].tolist()
print(final.state, final.dropped, recording.complete, counts == list(range(i)))
"""


def test_a_real_file_system_that_is_full(tmp_path: Path) -> None:
    """A 256 kB tmpfs in a mount namespace of its own."""
    if subprocess.run(["unshare", "-rm", "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine permits no mount namespace")
    done = subprocess.run(
        ["unshare", "-rm", sys.executable, "-c", TMPFS, str(tmp_path)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        timeout=600,
        check=False,
    )
    if done.returncode == 77:
        pytest.skip("this machine permits no tmpfs mount")
    error, back, final = done.stdout.splitlines()
    print(back)
    assert "No space left on device" in error and final == "closed 0 True True", done.stderr


def test_a_folder_that_cannot_be_written_is_said_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"none/run\.mcap: cannot create: No such file or directory"
    ):
        WriterThread(tmp_path / "none" / "run.mcap", [], "", RunInfo())
    tmp_path.chmod(0o500)
    if os.access(tmp_path, os.W_OK):
        pytest.skip("this user writes to read-only folders")
    with pytest.raises(RecordingError, match=r"run\.mcap: cannot create: Permission denied"):
        WriterThread(tmp_path / "run.mcap", [], "", RunInfo())
