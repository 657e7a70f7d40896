"""What other packages add, by the entry points of their distributions: effects, sensors, importers.

A plug-in that cannot be loaded, or offers something else than it says, is left out, and one line on
standard error names it with its package. What a plug-in raises later, `blamed` puts in its name.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from multiprocessing import parent_process
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

EFFECTS, SENSORS, IMPORTERS = "gritd.effects", "gritd.sensors", "gritd.importers"  # the groups
PATIENCE = 5.0  # [s] that a plug-in may take to be imported
AGAIN = 0.5  # [s] after which one is interrupted once more that catches everything
SHOWN = 60  # characters of what a plug-in prints

left_out: dict[tuple[str, str], str] = {}  # (group, name) of what cannot be used -> the line


class PluginError(Exception):
    """A plug-in cannot be used: one line that names its distribution."""


class _TooLong(BaseException):
    """A plug-in is still being imported after PATIENCE."""


def plugins(group: str, required: bool = False) -> dict[str, Any]:
    """What the entry points of a group name, by their names, in order; without what cannot be
    loaded, which is said. Where all are required that raises PluginError.
    """
    objects: dict[str, Any] = {}
    offered = sorted(_offered(group), key=lambda each: each.name)
    names = [entry.name for entry in offered]

    for entry in offered:
        try:
            if names.count(entry.name) > 1:
                raise refused(group, entry.name, "found it twice; expected each name once")
            objects[entry.name] = _loaded(entry)
        except PluginError as error:
            if required:
                raise
            leave_out(group, entry.name, error)

    return objects


def leave_out(group: str, name: str, error: PluginError) -> None:
    """Say, once, that a plug-in is not used."""
    if (group, name) not in left_out:
        left_out[group, name] = str(error)
        _say(f"{error}; it is left out")


def without(group: str, name: str) -> str:
    """' (...)' where a plug-in of this name was left out, to end the line that misses it."""
    return f" ({left_out[group, name]})" if (group, name) in left_out else ""


def _offered(group: str) -> EntryPoints:
    # loaded here: it takes a fifth of the time in which a command without plug-ins ends
    from importlib.metadata import entry_points

    return entry_points(group=group)


def _loaded(entry: EntryPoint) -> Any:
    """Raises PluginError, also where the plug-in ends the program or takes too long."""
    printed = StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed), _hurried():
            loaded = entry.load()
    except KeyboardInterrupt:
        raise
    except _TooLong:
        why = f"its import takes more than {PATIENCE:g} s"
        raise refused(entry.group, entry.name, why) from None
    except SystemExit as error:
        why = f"its import ends the program (exit {error.code})"
        raise refused(entry.group, entry.name, why) from None
    except BaseException as error:
        why = f"cannot be loaded: {in_words(error)}"
        raise refused(entry.group, entry.name, why) from None

    if words := " ".join(printed.getvalue().split()):
        _say(str(refused(entry.group, entry.name, f"its import prints {words[:SHOWN]!r}")))
    return loaded


@contextmanager
def _hurried() -> Iterator[None]:
    """End what runs in it after PATIENCE: in the main thread, which alone can be interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        raise _TooLong

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def refused(group: str, name: str, why: str) -> PluginError:
    """The error for a plug-in that offers something else than was expected."""
    named = [each for each in _offered(group) if each.name == name]
    packages = ", ".join(sorted({each.dist.name for each in named if each.dist})) or "unknown"
    return PluginError(f"plug-in {name} of {group} (package {packages}): {why}")


def in_words(error: BaseException) -> str:
    """An exception of a plug-in in at most 100 characters."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:100]


# --- whose fault it was ---


def blamed(trace: TracebackType | None) -> str:
    """'plug-in NAME of GROUP (package P)' where an exception was raised in a plug-in, or in what it
    called; '' elsewhere.
    """
    found = ""
    while trace is not None:
        found = owner(trace.tb_frame) or found
        trace = trace.tb_next
    return found


def running(thread: int) -> str:
    """The same for what a thread is in just now."""
    frame = sys._current_frames().get(thread)
    while frame is not None:
        if found := owner(frame):
            return found
        frame = frame.f_back
    return ""


def owner(frame: FrameType) -> str:
    """The same for the module of a frame."""
    return of_module(str(frame.f_globals.get("__name__", "")))


def of_module(module: str) -> str:
    """The same for a module; by the first word of its name."""
    top = module.partition(".")[0]
    return "" if top in ("gritd", "__main__", "") else _owners().get(top, "")


_known_owners: dict[str, str] = {}


def _owners() -> Mapping[str, str]:
    """Top-level module -> plug-in that lies in it."""
    if not _known_owners:
        from importlib.metadata import entry_points

        _known_owners["gritd"] = ""
        for group in (EFFECTS, SENSORS, IMPORTERS):
            for entry in entry_points(group=group):
                package = entry.dist.name if entry.dist else "unknown"
                named = f"plug-in {entry.name} of {group} (package {package})"
                _known_owners.setdefault(entry.module.partition(".")[0], named)
    return _known_owners


def _say(line: str) -> None:
    if parent_process() is None:  # a worker's parent has said it
        print(f"gritd: {line}", file=sys.stderr, flush=True)
