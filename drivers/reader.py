"""One thread a device: open, read, decode, queue; reopen with back-off when the hardware fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event, Thread

from gritd.drivers.decoder import Decoder
from gritd.drivers.errors import DeviceError, one_line
from gritd.drivers.link import Chunk, Link
from gritd.drivers.queue import ReadingQueue
from gritd.estimator.plugins import running
from gritd.estimator.threads.waiting import wait_until

BACKOFF_FIRST = 0.1  # [s]
BACKOFF_LAST = 5.0  # [s]

Tap = Callable[[int, bytes], None]


@dataclass(frozen=True)
class ReaderStats:
    """What a reader has seen since its start."""

    device: str
    state: str  # OPEN, WAITING to reopen, ENDED when stopped, DEAD
    last_error: str  # one line; empty if there was none
    last_received: int  # [ns] when the last chunk came; 0 before the first
    bytes: int
    frames: int  # good ones
    bad: int  # wrong checksum or content
    garbage: int  # bytes outside good frames
    lost: int  # by gaps of the sequence number
    errors: int  # error frames of the CAN controller
    duplicates: int
    unknown: int  # good frames no channel wants
    quarantined: int  # impossible values refused
    incomplete: int  # wrench cycles with a missing frame
    mistimed: int  # frames whose device time cannot be right
    clock_steps: int  # times the device's clock jumped
    clock_step: float  # how far, the last time [s]
    turns_unknown: int  # silences of an encoder in which its counter may have wrapped
    readings: int
    reopened: int  # times the device was opened again
    hint: str  # what is likely wrong with its configuration, by what comes; '' as a rule


class Reader:
    """Reads one device into the queue until it is stopped.

    tap, if given, is called with (received [ns], bytes) of every chunk before it is decoded: a wire
    log. Before the first chunk of each opening it is called without bytes.
    """

    def __init__(
        self, device: str, link: Link, decoder: Decoder, queue: ReadingQueue, tap: Tap | None = None
    ) -> None:
        self.device = device
        self.decoder = decoder
        self._link = link
        self._queue = queue
        self._tap = tap

        self._stop = Event()
        self._thread: Thread | None = None
        self._state = "ENDED"
        self._last_error = ""
        self._last_received = 0
        self._bytes = self._readings = self._opened = 0
        self._new_session = False
        # moves while the thread is not held up in the hardware: the watchdog's pulse
        self.beats = 0

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def inside(self) -> str:
        """The plug-in that the thread is in just now; '' where it is in none."""
        return running(self._thread.ident or 0) if self._thread else ""

    def start(self) -> None:
        """Start the thread, also again after it ended or died."""
        if self.alive:
            return
        self._stop.clear()
        self._state = "WAITING"
        self._thread = Thread(target=self._run, name=f"reader {self.device}", daemon=True)
        self._thread.start()

    def stop(self, timeout: float = 0.2) -> bool:
        """End the thread and close the device; False if it did not end within `timeout` [s]."""
        self._stop.set()
        wait_until(lambda: not self.alive, timeout)
        return not self.alive

    def stats(self) -> ReaderStats:
        counts = self.decoder.framing.counts
        sensors = self.decoder.sensors
        steps, step = self.decoder.step

        return ReaderStats(
            device=self.device,
            state=self._state,
            last_error=self._last_error,
            last_received=self._last_received,
            bytes=self._bytes,
            frames=counts.good,
            bad=counts.bad + self._link.damaged,
            garbage=counts.garbage,
            lost=counts.lost,
            errors=counts.errors,
            duplicates=self.decoder.duplicates,
            unknown=self.decoder.unknown,
            quarantined=sum(sensor.quarantined for sensor in sensors),
            incomplete=sum(sensor.incomplete for sensor in sensors),
            mistimed=self.decoder.mistimed,
            clock_steps=steps,
            clock_step=step,
            turns_unknown=sum(sensor.turns_unknown for sensor in sensors),
            readings=self._readings,
            reopened=max(self._opened - 1, 0),
            hint=next((s.failed for s in sensors if s.failed), self.decoder.framing.hint),
        )

    def _run(self) -> None:
        try:
            self._read_until_stopped()
            self._state = "ENDED"
        # a fault of ours: never silent, the daemon sees DEAD and its reason
        except Exception as error:
            self._last_error = f"{self.device}: {type(error).__name__}: {one_line(error)}"
            self._state = "DEAD"
        finally:
            self._link.close()

    def _read_until_stopped(self) -> None:
        backoff = BACKOFF_FIRST
        while not self._stop.is_set():
            before = self._bytes
            try:
                self._session()
            except DeviceError as error:
                self._last_error = str(error)

            self._link.close()
            self._state = "WAITING"
            if self._bytes > before:
                backoff = BACKOFF_FIRST
            self.beats += 1
            self._stop.wait(backoff)
            backoff = min(2 * backoff, BACKOFF_LAST)

    def _session(self) -> None:
        """From one opening to the stop, or to the failure that raises DeviceError."""
        self._link.open()
        self._opened += 1
        self._new_session = True
        self.decoder.restart()
        self._state = "OPEN"

        while not self._stop.is_set():
            chunk = self._link.read()
            self.beats += 1
            if chunk is not None:
                self._take(chunk)

    def _take(self, chunk: Chunk) -> None:
        if not chunk.data:  # of a recorded wire: the device was opened here
            self.decoder.restart()
            return

        self._bytes += len(chunk.data)
        self._last_received = chunk.received
        if self._tap is not None:
            if self._new_session:
                self._tap(chunk.received, b"")
            self._tap(chunk.received, chunk.data)
        self._new_session = False

        readings = self.decoder.decode(chunk.received, chunk.data)
        self._readings += len(readings)
        if readings:
            self._queue.put(readings)
