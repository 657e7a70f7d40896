"""`gritd view` next to a daemon, as a process of its own that ends with it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gritd.tools.cli.offspring import ends_with_us
from gritd.tools.cli.optional import require

STOP = 10.0  # [s] that it may take to end


@contextmanager
def shown(socket: Path) -> Iterator[None]:
    """The page of the daemon at a socket, as long as the block lasts. It says itself where it is,
    or why it is not; the daemon does not care. Raises CommandError where its packages are missing.
    """
    for package in ("starlette", "uvicorn"):
        require(package, "--view")
    command = [sys.executable, "-m", "gritd", "view", "--any-port", "--socket", str(socket)]
    process = subprocess.Popen(command, start_new_session=True, preexec_fn=ends_with_us())

    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(STOP)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
