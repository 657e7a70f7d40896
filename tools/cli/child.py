"""A Python module run as a process of its own, and what it says."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from queue import Empty, Queue
from threading import Thread
from typing import IO

from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.command import CommandError
from gritd.tools.cli.offspring import ends_with_us

STOP = 60.0  # [s] the longest a child may take to end, on a starved computer


@contextmanager
def interruptible() -> Iterator[StopRequest]:
    """What SIGINT and SIGTERM set; they interrupt nothing themselves: no child just started is
    lost.
    """
    stop = StopRequest()
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: stop.set()) for number in numbers]

    try:
        yield stop
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


class Child:
    """A Python module run as a process of its own, and what it says. Leaving the block ends it,
    whatever happened.

    While `stop` is set, waiting for it raises KeyboardInterrupt.
    """

    def __init__(self, stop: StopRequest, name: str, module: str, *arguments: str) -> None:
        self._stop, self._name = stop, name
        self._lines: Queue[str] = Queue()

        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            start_new_session=True,  # Ctrl-C reaches us alone: we stop them in order
            preexec_fn=ends_with_us(),
        )

        assert self._process.stdout is not None
        self._listener = Thread(target=self._listen, args=(self._process.stdout,), daemon=True)
        self._listener.start()

        self._said: list[str] = []

    def _listen(self, stream: IO[str]) -> None:
        for line in stream:
            self._lines.put(line.rstrip())

    def __enter__(self) -> Child:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        with (
            suppress(CommandError) if kind else nullcontext()
        ):  # what went wrong first is what is reported
            self.stop()

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def tell(self, line: str) -> None:
        """Write a line to its standard input. Raises CommandError if it has ended."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise CommandError(f"the {self._name} ended early") from None

    def line(self, timeout: float) -> str | None:
        """Its next line, or None. Raises as `check` does."""
        self.check()
        try:
            self._said.append(self._lines.get(timeout=max(timeout, 0.0)))
        except Empty:
            return None
        return self._said[-1]

    def check(self) -> None:
        """Raises CommandError, with its last line, if it has ended; KeyboardInterrupt if we are to
        stop.
        """
        if self._stop.is_set():
            raise KeyboardInterrupt
        if self._process.poll() is not None and self._lines.empty():
            last = self._said[-1] if self._said else "said nothing"
            raise CommandError(
                f"the {self._name} ended early (exit {self._process.returncode}): {last}"
            )

    def wait_for(self, beginning: str, timeout: float) -> str:
        """The next line that begins so. Raises CommandError."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            line = self.line(0.1)
            if line and line.startswith(beginning):
                return line
        raise CommandError(
            f"the {self._name} did not say {beginning.strip()!r} within {timeout:g} s"
        )

    def stop(self) -> list[str]:
        """SIGTERM, then the lines it still says. Raises CommandError if it does not end."""
        before = len(self._said)
        self._process.terminate()

        try:
            self._process.wait(STOP)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise CommandError(
                f"the {self._name} did not end within {STOP:g} s of SIGTERM"
            ) from None

        self._listener.join(STOP)  # to the end of what it said
        while not self._lines.empty():
            self._said.append(self._lines.get())
        return self._said[before:]
