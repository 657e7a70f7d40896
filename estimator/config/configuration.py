"""The configuration file: strict YAML to `Settings`, with the effective text that is saved next to
every run.

An error is one line, `FILE:LINE: key.path: found …; expected …`. The format itself stands in
table.py.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from gritd.estimator.config.effect_keys import EffectSchema
from gritd.estimator.config.effects import quantities
from gritd.estimator.config.settings import Settings
from gritd.estimator.config.table import table
from gritd.estimator.config.yamltree import (
    ConfigError,
    FilePosition,
    compose,
    dumped,
    is_ended,
    read_text,
    serialise,
)
from gritd.estimator.messages.run_info import RunInfo

__all__ = ["ConfigError", "Configuration", "EffectSchema", "load", "loads", "read_text", "reload"]


@dataclass(frozen=True)
class Configuration:
    """What a configuration file says.

    settings: typed, SI.
    text:     the effective YAML: every default filled in, units as written; loading it gives the
        same settings.
    source:   the file's name, for messages.
    run:      the `run` section, with its defaults where the file has none.
    ended:    whether the file shows its end by a line '...'.
    """

    settings: Settings
    text: str
    source: str
    run: RunInfo = field(default_factory=RunInfo)
    ended: bool = False


def load(
    path: str | os.PathLike[str], effect_schema: EffectSchema | None = quantities
) -> Configuration:
    """Read a configuration file; a relative DBC path counts from its folder. Raises ConfigError."""
    return loads(read_text(Path(path)), str(path), Path(path).resolve().parent, effect_schema)


def reload(path: str | os.PathLike[str]) -> Configuration:
    """Read a configuration file that takes the place of another while the daemon runs. Raises
    ConfigError.
    """
    return loads(whole_text(Path(path)), str(path), Path(path).resolve().parent)


def whole_text(path: Path) -> str:
    """The text of a configuration file that shows its end: an editor may not have written all of
    it. Raises ConfigError.
    """
    text = read_text(path)
    compose(text, str(path))
    if not is_ended(text):
        raise FilePosition(str(path), text.count("\n") + 1, "").error(
            "no end", "'...' as the last line"
        )
    return text


def with_engine(configuration: Configuration, engine: str | None) -> Configuration:
    """The configuration with another filter engine, in settings and text; None keeps its own."""
    if engine in (None, configuration.settings.filter.engine):
        return configuration
    document = yaml.safe_load(configuration.text)
    document["filter"]["engine"] = engine
    return loads(dumped(document), configuration.source)


def loads(
    text: str,
    name: str,
    folder: Path | None = None,
    effect_schema: EffectSchema | None = quantities,
) -> Configuration:
    """Read configuration text; `name` stands in messages. Without a folder a relative DBC path
    stays as it is.

    Raises ConfigError.
    """
    (settings, run), complete = table(folder, effect_schema).read(compose(text, name))

    return Configuration(settings, serialise(complete), name, run, is_ended(text))
