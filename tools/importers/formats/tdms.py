"""TDMS, as LabVIEW and DIAdem write it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import check_size, reading, since, table
from gritd.tools.importers.series.columns import SeriesTable, Wanted
from gritd.tools.importers.series.times import Nanoseconds


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The channels by name, `group.channel`; a table for each group and length of its channels. The
    clock is that of the waveform, where the file has one. Raises RigFileError.
    """
    with reading(path, "a TDMS file"), import_module("nptdms").TdmsFile.open(path) as file:
        alike: dict[tuple[object, ...], list[Any]] = {}
        for channel in (channel for group in file.groups() for channel in group.channels()):
            if len(channel):
                alike.setdefault(_clock_of(channel), []).append(channel)
        tables = [_table(path, channels, wanted) for channels in alike.values()]

    if not tables:
        raise RigFileError(f"{path}: found no values; expected channels of a TDMS file")
    return tables


def _clock_of(channel: Any) -> tuple[object, ...]:
    """What channels of one table have in common."""
    known = (channel.properties.get(name) for name in ("wf_start_time", "wf_increment"))
    return (channel.group_name, len(channel), *map(str, known))


def _table(path: Path, channels: list[Any], wanted: Wanted) -> SeriesTable:
    group, rows = channels[0].group_name, slice(None, wanted.rows)
    named = {f"{group}.{channel.name}": channel for channel in channels}
    chosen = {name: own for name, own in named.items() if wanted.has(name, group)}
    check_size(path, sum(len(channel) for channel in chosen.values()))

    arrays = {name: channel[rows] for name, channel in chosen.items()}
    units = {name: str(own.properties.get("unit_string", "")) for name, own in chosen.items()}
    clock = _clock(channels[0])
    return table(path, arrays, group, units, None if clock is None else clock[rows])


def _clock(channel: Any) -> Nanoseconds | None:
    """Times of a waveform [ns], since 1970 where it says when it began; None without."""
    increment = float(channel.properties.get("wf_increment") or 0.0)
    if increment <= 0.0:
        return None

    begins = channel.properties.get("wf_start_time")
    start = np.datetime64(0, "ns") if begins is None else np.datetime64(begins).astype("M8[ns]")
    offset = float(channel.properties.get("wf_start_offset") or 0.0)
    steps = since(offset + increment * np.arange(len(channel)))
    return np.asarray(max(int(start.astype(np.int64)), 0) + steps)
