"""Commands in the process of the test."""

from __future__ import annotations

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

from gritd.config import packaged
from gritd.tools.main import main

AS_PROCESSES = "the commands as processes"  # where a figure was taken
CONFIG = ("--config", packaged())


def in_process(command, *arguments):
    """Exit code and lines of a command, in this process."""
    out = StringIO()
    with redirect_stdout(out), redirect_stderr(out):
        code = main([command, *map(str, arguments)])
    return code, out.getvalue().splitlines()
