"""What ends a command: an exit code and one line on standard error, never a traceback."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

from gritd.drivers.errors import DeviceError, DeviceSettingsError
from gritd.estimator.config.yamltree import ConfigError
from gritd.estimator.limits import LimitsError
from gritd.estimator.plugins import PluginError, blamed, in_words
from gritd.estimator.visible import brief
from gritd.tools.cli import memory
from gritd.tools.cli.command import DAMAGED, DONE, FAILED, INTERRUPTED, USAGE, CommandError

SETTINGS = (
    ConfigError,
    DeviceSettingsError,
    LimitsError,
    PluginError,
)  # what the user set is wrong
KNOWN = (CommandError, DeviceError, *SETTINGS)  # each is one line for the user


def guarded(command: Callable[[], int | None]) -> int:
    """The exit code of a command, whatever it raises."""
    try:
        code = int(command() or DONE)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        _leave_output()
        return DONE
    except SystemExit as error:
        if not blamed(error.__traceback__):
            raise
        return _fail(_of_plugin(error))
    except Exception as error:
        try:
            sys.stdout.flush()
        except OSError:
            _leave_output()
        known = isinstance(error, KNOWN) or memory.line(error)
        return _fail(error if known or not blamed(error.__traceback__) else _of_plugin(error))


def _of_plugin(error: BaseException) -> PluginError:
    """What a plug-in raised, in its name."""
    named = PluginError(f"{blamed(error.__traceback__)}: {in_words(error)}")
    named.__cause__ = error
    return named


def _fail(error: Exception) -> int:
    """One line for the user, and the exit code."""
    if os.environ.get("GRITD_TRACEBACK"):
        raise error
    print(f"gritd: {brief(_one_line(error))}", file=sys.stderr)
    if isinstance(error, CommandError):
        return error.code
    if memory.line(error):
        return DAMAGED
    return USAGE if isinstance(error, SETTINGS) else FAILED


def _one_line(error: Exception) -> str:
    """The message of a known error; an unexpected one says so, and how to see more."""
    text = " ".join(str(error).split())
    if want := memory.line(error):
        return want
    if isinstance(error, OSError) and error.strerror:
        where = f"{error.filename}: " if error.filename else ""
        return where + error.strerror.lower()
    if isinstance(error, (OSError, *KNOWN)):
        return text
    return f"internal error: {type(error).__name__}: {text} (GRITD_TRACEBACK=1 shows where)"


def _leave_output() -> None:
    """Its reader has gone, or it is full: nothing more goes there, not even as Python flushes at
    exit.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
