"""What all sensors say during a procedure, kept as a recording: a wheel spun in the air, touches of
the surface, a plate that is pressed.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.messages.readings import CHANNELS, Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.calibrate.live import PATIENCE, SHOWN, reading
from gritd.tools.cli.command import FAILED, USAGE, CommandError
from gritd.tools.cli.files import unwritten, vacant
from gritd.tools.cli.terminal import LiveLine

INTERVAL = 0.02  # [s] between two looks at the queue
NOTES = "recorded by gritd calibrate"


def capture(configuration: Configuration, path: Path, seconds: float | None, what: str) -> Path:
    """Record the configured devices until Enter, or for so long [s]. Raises CommandError where
    nothing is read, or nobody can press Enter and no time is stated.
    """
    vacant(path)
    until = f"for {seconds:g} s" if seconds else "then press Enter"
    print(f"{what}, {until}", file=sys.stderr, flush=True)
    ended = _until(seconds)

    try:
        writer = RunWriter(path, (), configuration.text, RunInfo(path.stem, notes=NOTES))
        count = _record(configuration, writer, ended)
        writer.close()
    except RecordingError as error:
        raise unwritten(error) from None

    if not count:
        path.unlink()
        raise CommandError(
            f"found no reading in {PATIENCE:g} s; expected the sensors connected", FAILED
        )
    return path


def _record(configuration: Configuration, writer: RunWriter, ended: Callable[[], bool]) -> int:
    """Readings written; none where no sensor says anything."""
    line, last, count = LiveLine(sys.stderr), dict[str, Reading](), 0
    begin = shown = time.monotonic()

    with reading(configuration.settings) as drain:
        while not ended() and (count or time.monotonic() - begin < PATIENCE):
            time.sleep(INTERVAL)
            for one in drain():
                writer.reading(one)
                last[one.channel] = one
                count += 1
            if line.terminal and time.monotonic() - shown > SHOWN:
                shown = time.monotonic()
                line.show(_seen(shown - begin, last))

    line.clear()
    return count


def _seen(elapsed: float, last: dict[str, Reading]) -> str:
    """The newest raw value of every channel."""
    parts = [f"{channel} {_value(last[channel])}" for channel in CHANNELS if channel in last]
    return f"{elapsed:.0f} s: " + ", ".join(parts)


def _value(one: Reading) -> str:
    if isinstance(one.value, tuple):
        named = zip(CHANNELS[one.channel], one.value, strict=True)
        return " ".join(f"{name} {value:.4g}" for name, value in named if name in ("fz", "ty"))
    return f"{one.value:.6g}"


def _until(seconds: float | None) -> Callable[[], bool]:
    """Whether it is over: after a time, or when Enter is pressed."""
    if seconds:
        end = time.monotonic() + seconds
        return lambda: time.monotonic() >= end

    pressed, silent = threading.Event(), threading.Event()

    def wait() -> None:
        (pressed if sys.stdin.readline() else silent).set()

    threading.Thread(target=wait, daemon=True).start()

    def over() -> bool:
        if silent.is_set():
            raise CommandError("standard input ended; expected Enter, or --seconds", USAGE)
        return pressed.is_set()

    return over
