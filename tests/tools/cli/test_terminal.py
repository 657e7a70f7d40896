"""What is printed, and what the terminal gets of it."""

from __future__ import annotations

import sys
from io import StringIO

from gritd.tools.cli.terminal import control, shown


def test_every_printed_line_is_made_visible() -> None:
    out, error = StringIO(), StringIO()
    with shown(out, error):
        print("run \x1b[31mred\nsecond line")
        print("\x9bbad", file=sys.stderr)
    assert out.getvalue() == "run \\x1b[31mred\nsecond line\n"
    assert error.getvalue() == "\\x9bbad\n"


def test_the_program_itself_may_move_the_cursor() -> None:
    out = StringIO()
    with shown(out, StringIO()):
        print("\r\x1b[Khalf done", file=control(sys.stdout), end="")
    assert out.getvalue() == "\r\x1b[Khalf done"


def test_it_may_be_asked_for_twice() -> None:
    """A command that runs another."""
    out = StringIO()
    with shown(out, StringIO()), shown(sys.stdout, sys.stderr):
        print("\x1b")
    assert out.getvalue() == "\\x1b\n"
