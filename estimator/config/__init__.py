"""The configuration file: strict YAML to `Settings`, with the effective text that is saved beside every run.

An error is one line, `FILE:LINE: key.path: found …; expected …`. The format itself stands in table.py.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass, field
from pathlib import Path

from estimator.config.effects import quantities
from estimator.config.table import EffectSchema, table
from estimator.config.yamltree import MAX_BYTES, ConfigError, compose, serialise
from estimator.recording import RunInfo
from estimator.settings import Settings

__all__ = ["ConfigError", "Configuration", "EffectSchema", "load", "loads", "read_text"]


@dataclass(frozen=True)
class Configuration:
    """What a configuration file says.

    settings: typed, SI.
    text:     the effective YAML: every default filled in, units as written; loading it gives the same settings.
    source:   the file's name, for messages.
    run:      the `run` section, with its defaults where the file has none.
    """

    settings: Settings
    text: str
    source: str
    run: RunInfo = field(default_factory=RunInfo)


def load(path: str | os.PathLike[str], effect_schema: EffectSchema | None = quantities) -> Configuration:
    """Read a configuration file; a relative DBC path counts from its folder. Raises ConfigError."""
    return loads(read_text(Path(path)), str(path), Path(path).resolve().parent, effect_schema)


def loads(
    text: str, name: str, folder: Path | None = None, effect_schema: EffectSchema | None = quantities
) -> Configuration:
    """Read configuration text; `name` stands in messages. Without a folder a relative DBC path stays as it is.

    Raises ConfigError.
    """
    (settings, run), complete = table(folder, effect_schema).read(compose(text, name))
    return Configuration(settings, serialise(complete), name, run)


def read_text(path: Path, expected: str = "a configuration file") -> str:
    """Text of a regular file of bounded size; a pipe or a device is refused without waiting for it.

    Raises ConfigError, which says what was expected.
    """
    try:
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise ConfigError(f"{path}: found something that is no regular file; expected {expected}")
            data = stream.read(MAX_BYTES + 1)
    except IsADirectoryError:
        raise ConfigError(f"{path}: found a directory; expected {expected}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"{path}: found {str(reason).lower()}; expected {expected}") from None
    if len(data) > MAX_BYTES:
        raise ConfigError(f"{path}: found more than {MAX_BYTES // 1024} KiB; expected {expected}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}:{line}: document: found a byte that is not UTF-8; expected UTF-8 text") from None
