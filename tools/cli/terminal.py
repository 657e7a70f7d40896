"""Standard output and error as commands write to them: no control character of a text that is
printed reaches the terminal.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import TextIO, cast

from gritd.estimator.visible import visible


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
