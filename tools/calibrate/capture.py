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
from gritd.estimator.messages.readings import CHANNELS, NS, Reading
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


def _record(
    configuration: Configuration, writer: RunWriter, ended: Callable[[float, float], bool]
) -> int:
    """Readings written, until it is `ended` by the time that they cover and that nothing came [s];
    none where no sensor says anything.
    """
    line, last, first, count = LiveLine(sys.stderr), dict[str, Reading](), 0, 0
    covered = silent = 0.0

    with reading(configuration.settings) as drain:
        heard = shown = time.monotonic()
        while not ended(covered, silent) and (count or silent < PATIENCE):
            time.sleep(INTERVAL)
            silent = time.monotonic() - heard
            for one in drain():
                writer.reading(one)
                last[one.channel] = one
                first, count = first or one.stamp, count + 1
                covered, heard = (one.stamp - first) / NS, time.monotonic()
            if line.terminal and time.monotonic() - shown > SHOWN:
                shown = time.monotonic()
                line.show(_seen(covered, last))

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


def _until(seconds: float | None) -> Callable[[float, float], bool]:
    """Whether it is over: the readings cover so long, or no more come; or Enter is pressed."""
    if seconds:
        return lambda covered, silent: covered >= seconds or silent >= PATIENCE

    pressed, closed = threading.Event(), threading.Event()

    def wait() -> None:
        (pressed if sys.stdin.readline() else closed).set()

    threading.Thread(target=wait, daemon=True).start()

    def over(covered: float, silent: float) -> bool:
        if closed.is_set():
            raise CommandError("standard input ended; expected Enter, or --seconds", USAGE)
        return pressed.is_set()

    return over
