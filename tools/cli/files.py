"""The files of a command line, with one exit code for one mistake: 2 where a name is wrong, 3 where
a content is.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from gritd.estimator.config.settings import Settings
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.recording.tables import NOTHING, Fields
from gritd.estimator.visible import visible
from gritd.tools.cli.command import DAMAGED, FAILED, USAGE, CommandError

WRONG_NAME = (
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EEXIST,
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
)


def recording(path: Path, tables: Mapping[str, Fields] = NOTHING) -> Recording:
    """A recording to read, and what will be asked of it (see `salvage.read`). Raises CommandError,
    2 where there is no such file, 3 where it is no recording. What is odd about it goes to standard
    error.
    """
    try:
        made = read(path, tables=tables)
    except RecordingError as error:
        raise unread(path, error) from None
    for note in made.notes:
        print(visible(f"gritd: note: {path}: {note}"), file=sys.stderr)
    return made


def unread(path: Path, error: RecordingError) -> CommandError:
    """What a command says of an input that cannot be read."""
    return CommandError(error, DAMAGED if path.exists() else USAGE)


def open_to_all(source: Path, settings: Settings) -> list[str]:
    """A line for each trusted file that anybody may change: the configuration, and the databases of
    its CAN buses.
    """
    databases = {Path(device.dbc) for device in settings.devices.values() if device.dbc}
    lines = [_open_to_all(source, "which devices are opened and where files go")]
    lines += [_open_to_all(path, "what the messages mean") for path in sorted(databases)]
    return [line for line in lines if line]


def _open_to_all(path: Path, power: str) -> str:
    """One line where anybody may change a file; '' otherwise."""
    for place in (path, path.resolve().parent):
        with suppress(OSError):
            mode = place.stat().st_mode
            if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
                return (
                    f"{path}: anybody may change it, by the permissions of {place};"
                    f" whoever does decides {power}"
                )
    return ""


def vacant(path: Path) -> Path:
    """The name of a file to be made. Raises CommandError where there is one already or none can be
    made there.
    """
    if path.exists() or path.is_symlink():
        raise CommandError(f"{path}: is there already; expected the name of a new file", USAGE)

    _check_folder(path)
    return path


def writable(path: Path, replaced: bool = False) -> Path:
    """The name of a file to be written, also over one that is there. Raises CommandError where it
    cannot be.

    replaced: another file takes the place of one that is there, so that its folder has to be
    writable too.
    """
    there = os.path.exists(path)  # also where its folder may not be looked into
    if os.path.isdir(path):
        raise CommandError(f"{path}: found a folder; expected the name of a file to write", USAGE)
    if there and not os.access(path, os.W_OK):
        raise CommandError(f"{path}: may not be written; expected a file of your own", USAGE)

    if replaced or not there:
        _check_folder(path)
    return path


def _check_folder(path: Path) -> None:
    """Raises CommandError where no file can be made in the folder of `path`: an unnamed one is
    made there, since permissions do not tell of every file system.
    """
    folder = path.parent

    try:
        if not folder.is_dir():
            raise CommandError(
                f"{path}: found no folder {folder}; expected one to write into", USAGE
            )
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        reason = (error.strerror or "cannot write").lower()
        raise CommandError(
            f"{path}: may not write into {folder} ({reason}); expected a folder of your own",
            USAGE if error.errno in WRONG_NAME else FAILED,
        ) from None


def unwritten(error: RecordingError) -> CommandError:
    """What a command says of a file it could not write: code 2 for its name, 1 for the rest."""
    return CommandError(error, USAGE if error.errno in WRONG_NAME else FAILED)
