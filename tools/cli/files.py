"""The files of a command line, with one exit code for one mistake: 2 where a name is wrong, 3 where
a content is.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording, read
from gritd.estimator.recording.tables import NOTHING, Fields
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
    2 where there is no such file, 3 where it is no recording.
    """
    try:
        return read(path, tables=tables)
    except RecordingError as error:
        raise unread(path, error) from None


def unread(path: Path, error: RecordingError) -> CommandError:
    """What a command says of an input that cannot be read."""
    return CommandError(error, DAMAGED if path.exists() else USAGE)


def open_to_all(path: Path) -> str:
    """One line where anybody may change a file that is trusted; '' otherwise."""
    for place in (path, path.resolve().parent):
        with suppress(OSError):
            mode = place.stat().st_mode
            if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
                return (
                    f"{path}: anybody may change it, by the permissions of {place};"
                    " whoever does decides which devices are opened and where files go"
                )
    return ""


def vacant(path: Path) -> Path:
    """The name of a file to be made. Raises CommandError where there is one already or none can be
    made there.
    """
    if path.exists() or path.is_symlink():
        raise CommandError(f"{path}: is there already; expected the name of a new file", USAGE)

    if not path.parent.is_dir():
        raise CommandError(
            f"{path}: found no folder {path.parent}; expected one to write into", USAGE
        )
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise CommandError(
            f"{path}: may not write into {path.parent}; expected a folder of your own", USAGE
        )

    return path


def unwritten(error: RecordingError) -> CommandError:
    """What a command says of a file it could not write: code 2 for its name, 1 for the rest."""
    return CommandError(error, USAGE if error.errno in WRONG_NAME else FAILED)
