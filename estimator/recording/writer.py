"""The writer thread: takes messages off the loop's hands and gets them onto the disk every fifth
of a second.

What has been written out survives the death of the process; a second thread waits for the medium
(fdatasync), so that a slow card delays nobody. A full or failing disk never reaches the loop:
messages queue, then the oldest are dropped and counted, and writing resumes when it can. A file
never has a gap: after a loss the next part begins (run.1.mcap, …), a recording of its own with
the same metadata. A part also begins where a PartStart stands in the queue.
"""

from __future__ import annotations

import errno
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Literal

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.backlog import Backlog, Item, PartStart
from gritd.estimator.recording.cdr import Topic, Values
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import part_path
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.syncer import Syncer
from gritd.estimator.threads.waiting import wait_until

CAPACITY = 50_000  # messages; 40 s of 1 kHz of readings with ticks
# [bytes] of an ordinary chunk; a fifth of a second of a whole rig makes half of it
LARGEST = 1 << 17
RETRY = 1.0  # [s] between attempts at a disk that failed
# So many messages are encoded in a tenth of a millisecond. Then the writer pauses for as long [s]:
# the loop, which may wait for the interpreter, shall not wait for all of a flush.
TURN, PAUSE = 16, 1e-4
_FULL = (errno.ENOSPC, errno.EDQUOT)
State = Literal["writing", "degraded", "closed"]


@dataclass(frozen=True)
class WriterStatus:
    """accepted = written + dropped + queued, exactly, at every moment."""

    state: State
    error: str  # the last one, kept after recovery; empty if there was none
    accepted: int  # messages handed in
    written: int  # handed to the kernel
    # lost: the queue was full, the message did not fit its topic, or the disk failed to the end
    dropped: int
    queued: int  # waiting, or being written
    files: tuple[Path, ...]  # the run's parts so far
    unfit: int = 0  # of the dropped, those that could not be written because of themselves
    suspect: bool = False  # the open file failed for another reason than a full disk


class WriterThread:
    """Writes one run. Made, started and stopped by the daemon, fed by the loop.

    Making it raises RecordingError if the first file cannot be created, ValueError if topics
    contradict each other; afterwards nothing is raised, `status` tells.
    """

    def __init__(
        self,
        path: Path | str,
        topics: Iterable[Topic],
        config_yaml: str,
        run: RunInfo,
        *,
        compression: str = "zstd",
        flush_interval: float = 0.2,
        capacity: int = CAPACITY,
        retry: float = RETRY,
        mode: int | None = None,
    ) -> None:
        self._queue = Backlog(capacity)
        self._sync = Syncer()
        self._parts = _Parts(
            Path(path),
            config_yaml,
            run,
            partial(RunWriter, topics=tuple(topics), compression=compression, mode=mode),
            self._sync.request,
        )

        self._interval = flush_interval
        self._retry = retry
        self._batch: list[Item] = []  # taken from the queue, not yet encoded
        self._lost = 0  # messages dropped between what was encoded last and the batch
        self._config = ""  # that of a PartStart among them
        self.beats = 0  # times round
        self._rejected = 0  # messages encoded since the last flush that did not fit their topic
        self._unfit = 0  # in all
        self._suspect = False  # the current file failed for another reason than a full disk

        self._state: State = "writing"
        self._error = ""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="writer", daemon=True)

    def start(self) -> None:
        self._sync.start()
        self._thread.start()

    def put(
        self, readings: Iterable[Reading], messages: Iterable[tuple[str, int, Values]] = ()
    ) -> None:
        """Hand over the readings that one tick consumed, then its messages. Never waits for the
        disk, never raises.
        """
        self._queue.put([*readings, *messages])

    def begin_part(self, config_yaml: str, message: tuple[str, int, Values]) -> None:
        """Go on in a new part from here, with this configuration; `message` is its first."""
        self._queue.put([PartStart(config_yaml, message)])

    def status(self) -> WriterStatus:
        accepted, written, dropped, queued = self._queue.counters()

        return WriterStatus(
            self._state,
            self._error,
            accepted,
            written,
            dropped,
            queued,
            tuple(self._parts.files),
            self._unfit,
            self._suspect,
        )

    @property
    def alive(self) -> bool:
        """Whether both threads run."""
        return self._thread.is_alive() and self._sync.alive

    @property
    def unconfirmed(self) -> float:
        """How long the medium has not confirmed what it was last asked to keep [s]; 0 where
        nothing is asked.
        """
        return self._sync.waiting()

    def stop(self, timeout: float = 2.0) -> WriterStatus:
        """Write what is queued, close the file with its index, and return the final counters.

        A disk that hangs is left alone after `timeout` [s]; the state is then not "closed", or
        an error says that the medium has not confirmed what it was given.
        """
        self._stopping.set()
        if self._thread.ident is None:  # never started
            self._attempt(self._finish)
        left = wait_until(lambda: not self._thread.is_alive(), timeout)

        confirmed, path = self._sync.stop(left), self._parts.files[-1]
        if self._state == "closed" and not confirmed:
            self._error = f"{path}: the medium has not confirmed the last of it"
        elif self._state == "closed":
            try:
                self._sync.raise_error(path)
            except RecordingError as error:
                self._error = str(error)

        return self.status()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopping.is_set():
            self.beats += 1
            due = max(
                due + (self._interval if self._state == "writing" else self._retry),
                time.monotonic(),
            )
            self._stopping.wait(due - time.monotonic())
            self._attempt(self._write_out)
        self._attempt(self._finish)

    def _attempt(self, action: Callable[[], None]) -> None:
        """Whatever goes wrong is said, and what could not be written is kept for the next
        attempt.
        """
        try:
            action()
        except RecordingError as error:
            self._fail(str(error), full=error.errno in _FULL)
        except Exception as error:  # this thread must outlive what nobody thought of
            self._fail(f"{self._parts.files[-1]}: {type(error).__name__}: {error}", full=False)

    def _fail(self, error: str, full: bool) -> None:
        self._state, self._error = "degraded", error
        self._suspect |= not full

    def _write_out(self) -> None:
        """Everything queued by now, in batches; first what an earlier attempt left."""
        self._sync.raise_error(self._parts.files[-1])
        if self._suspect:
            self._leave()
            self._suspect = False
        self._flush()
        for _ in range(self._queue.batches()):
            self._next_batch()
        self._state = "writing"

    def _leave(self) -> None:
        """Leave a file that failed. Where a PartStart waits, it takes what came before that, if it
        can: so the next part begins with the first state. Otherwise it is left at once.
        """
        begun = bool(self._batch) and isinstance(self._batch[0], PartStart)
        if begun or self._queue.starts:
            with suppress(RecordingError):
                return self._flush()
        self._parts.next(lost=0)

    def _next_batch(self) -> None:
        if not self._batch:
            self._batch, lost, config = self._queue.take()
            self._lost += lost
            self._config = config or self._config
        if self._batch:
            self._begin_part()
        self._encode()
        self._flush()

    def _begin_part(self) -> None:
        """After a loss, and where a PartStart leads the batch."""
        first = self._batch[0]
        start = first if isinstance(first, PartStart) else None
        if self._lost or start:
            self._parts.next(self._lost, start.config_yaml if start else self._config)
            self._lost, self._config = 0, ""
        if start:
            self._batch[0] = start.message

    def _encode(self) -> None:
        following, batch = list[Item](), iter(self._batch)
        self._batch = following  # only now: making them may fail where memory is short
        turns = 0

        for item in batch:
            turns = (turns + 1) % TURN  # a small number, which takes no memory
            try:
                if turns == 0:
                    time.sleep(PAUSE)
                if isinstance(item, Reading):
                    self._parts.writer.reading(item)
                elif not isinstance(item, PartStart):  # which was taken apart before
                    self._parts.writer.message(*item)
            except Exception as error:  # the message's own fault: the next one may be good
                self._rejected += 1
                self._unfit += 1
                self._error = str(error)

    def _flush(self) -> None:
        self._parts.writer.write_out()
        self._queue.settle(dropped=self._rejected)
        self._rejected = 0
        self._sync.request(self._parts.writer.fileno())

    def _finish(self) -> None:
        try:
            self._write_last()
        finally:
            self._queue.drop_all()
            self._parts.writer.finish(self._sync.request)
        self._state = "closed"

    def _write_last(self) -> None:
        try:
            self._write_out()
        # there is no later attempt: once more; numpy says SystemError where memory is short
        except (MemoryError, SystemError):
            self._write_out()


class _Parts:
    """The file being written, and how to make the one that continues it."""

    def __init__(
        self,
        path: Path,
        config_yaml: str,
        run: RunInfo,
        make: Callable[..., RunWriter],
        sync: Callable[[int], None],
    ) -> None:
        self._run, self._sync = run, sync
        self._config = config_yaml
        self._make = partial(make, chunk_size=sys.maxsize)  # see _flush

        self.writer = self._make(path, config_yaml=config_yaml, run=run)
        self.writer.expect(LARGEST)
        self.files = [path]
        self._sync_name(path)

    def next(self, lost: int, config_yaml: str = "") -> None:
        """Go on in a new file, with what the old one could not take, and with another
        configuration if one is given.

        Raises RecordingError, and nothing has changed.
        """
        paths = ((n, part_path(self.files[0], n)) for n in count(len(self.files)))
        number, path = next((n, path) for n, path in paths if not os.path.lexists(path))
        run = replace(self._run, part=number, lost_before=lost)
        with suppress(OSError):  # what is amiss, making the file says
            path.parent.mkdir(parents=True, exist_ok=True)
        new = self._make(path, config_yaml=config_yaml or self._config, run=run)
        self._config = config_yaml or self._config
        old, self.writer = self.writer, new
        # at once: whoever tidies the folder must know which file is open
        self.files.append(path)
        new.adopt(old)

        with suppress(RecordingError):  # without an index it is readable still
            old.finish(self._sync)

        self._sync_name(path)

    def _sync_name(self, path: Path) -> None:
        """A file's name is its folder's: without this, a power cut may leave the file under the
        name of its draft.
        """
        with suppress(OSError):  # a folder that may be written but not read
            folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
            try:
                self._sync(folder)
            finally:
                os.close(folder)
