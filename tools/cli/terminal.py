"""Standard output and error as commands write to them: no control character of a text that is
printed reaches the terminal.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TextIO, cast

from gritd.estimator.visible import visible

START_OF_LINE = "\r\033[K"  # and nothing of what stood in the line
USUAL_WIDTH = 80  # of a terminal that does not tell its own


class _Shown:
    """A stream that makes every line visible before it passes it on."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        self.stream.write("\n".join(map(visible, text.split("\n"))))
        return len(text)

    def __getattr__(self, name: str) -> object:
        return getattr(self.stream, name)


@contextmanager
def shown(out: TextIO, error: TextIO) -> Iterator[None]:
    """Make everything visible that is printed meanwhile."""
    streams = [cast(TextIO, _Shown(control(stream))) for stream in (out, error)]
    with redirect_stdout(streams[0]), redirect_stderr(streams[1]):
        yield


def control(stream: TextIO) -> TextIO:
    """The stream that takes the program's own control sequences; the rest of a line is for
    `visible`.
    """
    return stream.stream if isinstance(stream, _Shown) else stream


class LiveLine:
    """A line that is rewritten on a terminal; elsewhere every text is a line of its own."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._open = control(stream), False
        self.terminal = stream.isatty()

    def show(self, text: str) -> None:
        """Put a text in the place of the last one."""
        text = visible(text)
        if self.terminal:
            width = os.get_terminal_size(self._stream.fileno()).columns or USUAL_WIDTH
            self._stream.write(f"{START_OF_LINE}{text[: width - 1]}")
        else:
            self._stream.write(f"{text}\n")
        self._stream.flush()
        self._open = self.terminal

    def keep(self) -> None:
        """Leave the last text where it is and go to the next line."""
        self._close("\n")

    def clear(self) -> None:
        """Take the last text away."""
        self._close(START_OF_LINE)

    def _close(self, ending: str) -> None:
        if self._open:
            self._stream.write(ending)
            self._stream.flush()
            self._open = False
