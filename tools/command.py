"""What every command shares: exit codes, its one error, and a parser that complains in one line."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

DONE, FAILED, USAGE, DAMAGED, INTERRUPTED = 0, 1, 2, 3, 130


class CommandError(Exception):
    """A command ends without success: one line for the user, and the exit code."""

    def __init__(self, message: object, code: int = FAILED) -> None:
        super().__init__(message)
        self.code = code


class Parser(argparse.ArgumentParser):
    """argparse whose usage error is one line, `gritd: …`, and exit code 2."""

    def error(self, message: str) -> NoReturn:
        print(f"gritd: {message} (see {self.prog} --help)", file=sys.stderr)
        sys.exit(USAGE)
