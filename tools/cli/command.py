"""What every command shares: exit codes, its one error, and a parser that complains in one line."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf, nan
from pathlib import Path
from typing import NoReturn

from gritd.estimator.config.names import EXPECTED, is_file_name
from gritd.estimator.visible import brief

DONE, FAILED, USAGE, DAMAGED, INTERRUPTED = 0, 1, 2, 3, 130


class CommandError(Exception):
    """A command ends without success: one line for the user, and the exit code."""

    def __init__(self, message: object, code: int = FAILED) -> None:
        super().__init__(message)
        self.code = code


@contextmanager
def os_errors(path: Path | None = None) -> Iterator[None]:
    """What the operating system refuses becomes a CommandError of the file, of `path` where the
    error names none.
    """
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise CommandError(f"{error.filename or path}: {reason}", USAGE) from None


class Parser(argparse.ArgumentParser):
    """argparse whose usage error is one line, `gritd: …`, and exit code 2."""

    def error(self, message: str) -> NoReturn:
        print(f"gritd: {brief(message)} (see {self.prog} --help)", file=sys.stderr)
        sys.exit(USAGE)


def add_configuration(parser: argparse.ArgumentParser, what: str, required: bool = False) -> None:
    """The options that name a configuration, `what` it is, and say that it may be another rig's."""
    parser.add_argument("--config", required=required, metavar="F", help=what)
    parser.add_argument(
        "--other-rig",
        action="store_true",
        help="F may be of another testbed than the recordings",
    )


def number(above: float = -inf, low: float = -inf) -> Callable[[str], float]:
    """An argparse type: a finite number greater than `above`, and `low` or more."""
    bounds = ((" above", above), (" from", low))
    expected = "a number" + "".join(f"{word} {bound:g}" for word, bound in bounds if bound > -inf)

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = nan
        if not (above < value < inf and low <= value):
            raise argparse.ArgumentTypeError(f"found {text[:40]!r}; expected {expected}")
        return value

    return read


def whole(low: int, high: int | None = None) -> Callable[[str], int]:
    """An argparse type: a whole number from `low`, up to `high` if there is one."""
    expected = f"a whole number from {low}" + ("" if high is None else f" to {high}")

    def read(text: str) -> int:
        value = int(text) if re.fullmatch(r"-?[0-9]{1,19}", text) else low - 1
        if value < low or (high is not None and value > high):
            raise argparse.ArgumentTypeError(f"found {text[:40]!r}; expected {expected}")
        return value

    return read


def file_name(text: str) -> str:
    """An argparse type: a name that can begin a file's."""
    if not is_file_name(text):
        raise argparse.ArgumentTypeError(f"found {text[:40]!r}; expected {EXPECTED}")
    return text
