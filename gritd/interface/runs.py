"""Recordings as arrays."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.configuration import Configuration, load, loads
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.recording import Recording
from gritd.estimator.recording.salvage import read as read_recording

Table = NDArray[np.void]  # structured, (n,)
Place = str | PathLike[str]


@dataclass(frozen=True)
class Run(Mapping[str, Table]):
    """One recording: a mapping from topic to a structured array (n,), read when it is asked for.

    Keys are topics without the leading slash: `"raw/motor_shunt"`, `"tick"`. Fields are those of
    docs/recording.md, and `log_time` [ns], the receive time. Values are raw: counts, volts, N.
    """

    recording: Recording

    @property
    def path(self) -> Path:
        return self.recording.path

    @property
    def info(self) -> RunInfo:
        """Name, nominal load [N], pass, starting position [m], operator, notes."""
        return self.recording.run

    @property
    def damage(self) -> list[str]:
        """What of the file could not be read, a line each."""
        return self.recording.damage

    @cached_property
    def configuration(self) -> Configuration | None:
        """The configuration that the recording was made with. Raises ConfigError."""
        text = self.recording.config_yaml
        return None if text is None else loads(text, f"{self.path}: gritd.config")

    def __getitem__(self, topic: str) -> Table:
        name = f"/{topic.lstrip('/')}"
        known = self.recording.topics.get(name)
        if known is None or not known.codec.flat or not self.recording.counts[name]:
            raise KeyError(topic)
        return self.recording.arrays(name)

    def __iter__(self) -> Iterator[str]:
        flat = (topic for topic in self.recording.topics.values() if topic.codec.flat)
        return (topic.name.lstrip("/") for topic in flat if self.recording.counts[topic.name])

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __repr__(self) -> str:
        """One line: a notebook shows it where a cell ends with a run."""
        load = "" if self.info.nominal_load is None else f", {self.info.nominal_load:g} N"
        count = self.recording.counts.total()
        return f"Run({str(self.path)!r}{load}, {count} messages of {len(self)} topics)"

    def frame(self, topic: str) -> Any:
        """A topic as a pandas data frame, by seconds since its first message. Raises ImportError
        without pandas, which gritd does not bring.
        """
        try:
            pandas = importlib.import_module("pandas")
        except ImportError:
            raise ImportError("frame: needs pandas: pip install pandas") from None

        rows = self[topic]
        time = (rows["log_time"] - rows["log_time"][:1]) / NS
        index = pandas.Index(time, name="time")
        return pandas.DataFrame({name: rows[name] for name in rows.dtype.names or ()}, index=index)


@overload
def read(files: Place) -> Run: ...  # type: ignore[overload-overlap]  # a str is one file
@overload
def read(files: Sequence[Place]) -> list[Run]: ...


def read(files: Place | Sequence[Place]) -> Run | list[Run]:
    """A recording, or several. Raises RecordingError, one line, for a file that is none.

    >>> run = read(recorded)
    >>> sorted(run)[:3]
    ['raw/carriage_encoder', 'raw/motor_shunt', 'raw/motor_temperature']
    >>> run["raw/motor_shunt"].dtype.names
    ('log_time', 'order', 'stamp', 'volts')
    """
    if isinstance(files, str | PathLike):
        return _run(Path(files))
    return [_run(Path(file)) for file in files]


def _run(path: Path) -> Run:
    """Its tables belong to the caller, who may write to them."""
    recording = read_recording(path, tables=None)
    recording.own_tables()
    return Run(recording)


def configured(config: Place | Configuration) -> Configuration:
    """A configuration, from its file if need be. Raises ConfigError, one line."""
    return config if isinstance(config, Configuration) else load(config)
