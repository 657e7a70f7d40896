"""The thread that waits for the medium (fdatasync), so that a slow card delays nobody."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path
from queue import SimpleQueue

from gritd.estimator.recording.mcapfile import RecordingError, sync
from gritd.estimator.threads.waiting import wait_until


class Syncer:
    """Waits for the medium in its own thread; a request made while one is waiting is covered by it
    or by the next.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # not an Event: where memory is short its lock can stay held, and all wait for ever
        self._wake: SimpleQueue[None] = SimpleQueue()
        self._files: dict[tuple[int, int], int] = {}  # device and inode -> a descriptor of our own
        self._error: OSError | None = None
        self._stopped = False
        self._since = 0.0  # when the sync under way began [s]; 0: there is none
        self._thread = threading.Thread(target=self._run, name="writer-sync", daemon=True)

    @property
    def alive(self) -> bool:
        return self._thread.is_alive()

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout: float) -> bool:
        """Sync what is asked for and end; False if that has not happened after `timeout` [s]: a
        disk may hang.
        """
        self._stopped = True
        self._wake.put(None)
        if self._thread.ident is None:
            self._sync()
        wait_until(lambda: not self.alive, timeout)
        return not self.alive

    def request(self, fileno: int) -> None:
        status = os.fstat(fileno)
        with self._lock:
            if (status.st_dev, status.st_ino) not in self._files:
                try:  # the writer may close its own while we wait
                    self._files[status.st_dev, status.st_ino] = os.dup(fileno)
                except OSError as error:
                    self._error = error
        self._wake.put(None)

    def raise_error(self, path: Path) -> None:
        """Raises RecordingError if a sync failed since the last call: the medium may lack what it
        was given.
        """
        with self._lock:
            error, self._error = self._error, None
        if error:
            raise RecordingError(f"{path}: cannot sync: {error.strerror}", error.errno) from error

    def waiting(self) -> float:
        """How long the medium has left a request unconfirmed [s]."""
        since = self._since
        return time.monotonic() - since if since else 0.0

    def _run(self) -> None:
        last = False
        while not last:
            self._wake.get()
            last = self._stopped  # what was asked for until then is still synced
            self._sync()

    def _sync(self) -> None:
        with self._lock:
            files, self._files = self._files, {}

        self._since = time.monotonic()

        for file in files.values():
            try:
                sync(file)
            except OSError as error:
                with self._lock:
                    self._error = error
            finally:
                os.close(file)

        self._since = 0.0
