"""A configuration file of the user's that a command changes: to another name, or in its place with
a backup.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from gritd.estimator.config import configuration as config
from gritd.tools.cli.command import USAGE, CommandError, os_errors
from gritd.tools.cli.files import writable
from gritd.tools.cli.yaml_edit import EditedYaml


def edited(path: Path) -> EditedYaml:
    """The file, to be changed. Raises ConfigError, also where it may be a part of another."""
    return EditedYaml(config.whole_text(path), str(path))


def target(source: Path, output: Path | None, in_place: bool, option: str) -> Path:
    """Where the changed file goes: `output`, or `source` itself with `in_place`. `option` names the
    output in messages. Raises CommandError, also where it cannot be written; ConfigError where the
    source may be cut short, since what is made of a part would look whole.
    """
    config.whole_text(source)
    if in_place and (output is None or output.resolve() == source.resolve()):
        return writable(source, replaced=True)

    if output is None:
        raise CommandError(f"expected {option} NEW.yaml, or --in-place to change {source}", USAGE)
    if in_place:
        raise CommandError(
            f"found {option} {output} and --in-place; expected one of them, or the same file", USAGE
        )
    if output.resolve() == source.resolve():
        raise CommandError(
            f"{option} {output}: is the configuration that is read; expected another name, "
            "or --in-place too, which keeps a backup",
            USAGE,
        )

    return writable(output, replaced=True)


def save(text: str, source: Path, place: Path) -> Path | None:
    """Write the changed text of `source` at `place`; returns the backup, where `place` is `source`.

    A relative path of a CAN database follows the file. What is written begins with '---' and ends
    with '...', so that no part of it passes for the whole. A text that is no valid configuration is
    not written. Raises ConfigError, CommandError.
    """
    own = place.resolve() == source.resolve()
    text = _begun(text if own else _moved(text, source, place))
    config.loads(text, str(place), place.resolve().parent)

    with os_errors(place):
        backup = _backed_up(source.resolve()) if own else None
        _replace(place.resolve(), text)
    return backup


def _begun(text: str) -> str:
    """The text with the mark '---' after its first comments."""
    lines = text.splitlines(keepends=True)
    first = next((i for i, line in enumerate(lines) if not _is_comment(line)), len(lines))
    if "".join(lines[first : first + 1]).startswith(("---", "%")):
        return text
    return "".join([*lines[:first], "---\n", *lines[first:]])


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith("#")


def _moved(text: str, source: Path, place: Path) -> str:
    """The text with relative paths of CAN databases that count from the folder of `place`."""
    document = EditedYaml(text, str(place))
    here, there = source.resolve().parent, place.resolve().parent
    if here == there:
        return text

    for name in document.keys("devices"):
        dbc = document.written("devices", name, "dbc")
        if dbc and not os.path.isabs(dbc):
            document.set(("devices", name, "dbc"), os.path.relpath(here / dbc, there))
    return document.text()


def _backed_up(path: Path) -> Path:
    """A copy of the file beside it, under a name that is free."""
    backup, number = path.with_name(f"{path.name}.bak"), 1
    while backup.exists():
        number += 1
        backup = path.with_name(f"{path.name}.bak{number}")
    shutil.copy2(path, backup)
    return backup


def _replace(path: Path, text: str) -> None:
    """Write the file at once: whoever reads it finds the old one or the new one, never a part."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")

    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(name, path.stat().st_mode & 0o7777 if path.exists() else 0o644 & ~_umask())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
