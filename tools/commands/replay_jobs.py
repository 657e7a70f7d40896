"""Several recordings replayed at once, each in a process; what each says stands in the order of the
files.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import NamedTuple

from gritd.tools.cli.command import DONE
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.progress import Progress
from gritd.tools.cli.workers import workers

One = Callable[[Path], int]  # replays a recording; its exit code


class Printed(NamedTuple):
    """What came of a recording."""

    code: int
    output: str
    complaints: str
    failed: bool  # it ended with an error, and the command with it


def each(paths: Sequence[Path], one: One, jobs: int) -> int:
    """The largest exit code; one after the other stops at the first error, and so does this. `one`
    can be pickled.
    """
    with workers(min(jobs, len(paths)), None) as (pool, _):
        waiting = [pool.submit(_printed, one, path) for path in paths]
        try:
            return _printed_in_order(waiting)
        finally:
            for future in waiting:
                future.cancel()


def _printed_in_order(waiting: Sequence[Future[Printed]]) -> int:
    """Print what is said in order, up to the first error."""
    code = DONE

    with Progress("replaying", len(waiting)) as progress:
        for future in waiting:
            result = future.result()
            progress.advance()
            sys.stdout.write(result.output)
            sys.stderr.write(result.complaints)
            if result.failed:
                return result.code
            code = max(code, result.code)

    return code


def _printed(one: One, path: Path) -> Printed:
    """A recording in this process."""
    Progress.shown = False
    output, complaints, returned = StringIO(), StringIO(), list[int]()

    def run() -> int:
        returned.append(one(path))
        return returned[0]

    with redirect_stdout(output), redirect_stderr(complaints):
        code = guarded(run)
    return Printed(code, output.getvalue(), complaints.getvalue(), not returned)
