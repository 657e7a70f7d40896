"""Progress: nothing for what is quick, a rewritten line on a terminal, plain lines elsewhere."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from io import StringIO

import pytest

from gritd.tools.cli.progress import Progress


class Clock:
    """A monotonic clock that a test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time, "monotonic", made)
    return made


@contextmanager
def terminal() -> Iterator[Callable[[], str]]:
    """Standard error is a terminal of 40 columns; gives what reads the characters it received."""
    far, near = pty.openpty()
    fcntl.ioctl(near, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 40, 0, 0))
    with os.fdopen(near, "w", encoding="utf-8") as stream, redirect_stderr(stream):
        yield lambda: _all_of(far)
    os.close(far)


def _all_of(far: int) -> str:
    """All that came: a pseudo-terminal hands it over in pieces."""
    pieces = b""
    while select.select([far], [], [], 0.5)[0]:
        pieces += os.read(far, 4096)
    return pieces.decode()


def counted(clock: Clock, seconds: float) -> None:
    """Ten steps in so many seconds."""
    with Progress("cases", 10) as progress:
        for _ in range(10):
            clock.now += seconds / 10.0
            progress.advance()


def test_what_takes_two_seconds_shows_nothing(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    counted(clock, 2.0)
    assert capsys.readouterr().err == ""


def test_lines_come_every_five_seconds_where_there_is_no_terminal(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    counted(clock, 30.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "cases: 2 of 10 (20%), 24 s left"
    assert len(lines) == 5


def test_a_terminal_has_one_line_that_is_taken_away(clock: Clock) -> None:
    with terminal() as received:
        counted(clock, 30.0)
        seen = received()

    assert seen.startswith("\r\x1b[Kcases: 1 of 10 (10%), 27 s left\r\x1b[K")
    assert seen.endswith("\r\x1b[K") and "\n" not in seen


def test_a_step_is_named_at_once_and_fits_into_the_terminal(clock: Clock) -> None:
    with terminal() as received:
        with Progress("diagnosing") as progress:
            progress.at("the noise of every run and of each of its channels")
        seen = received()

    assert seen.split("\r\x1b[K") == [
        "",
        "diagnosing: the noise of every run and "[:39],
        "",
    ]


def test_a_name_cannot_move_the_cursor(clock: Clock) -> None:
    stream = StringIO()
    with redirect_stderr(stream), Progress("run \x1b[2J", 2) as progress:
        clock.now += 10.0
        progress.advance()
    assert stream.getvalue() == "run \\x1b[2J: 1 of 2 (50%), 10 s left\n"
