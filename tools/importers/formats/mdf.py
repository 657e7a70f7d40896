"""MDF, as CANape, INCA and other measurement programs for vehicles write it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import check_size, reading, since, table
from gritd.tools.importers.series.columns import SeriesTable, Wanted
from gritd.tools.importers.series.times import NS


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The channels of each channel group, by its name or number: `group.channel`. The clock is the
    group's master channel, since 1970 where the file says when it began. Raises RigFileError.
    """
    library = import_module("asammdf")
    # that of a file which could not be opened complains with a traceback when it is freed
    library.blocks.mdf_v4.MDF4.__del__ = lambda self: None
    with reading(path, "an MDF file"), library.MDF(path) as file:
        numbers = [at for at, group in enumerate(file.groups) if group.channel_group.cycles_nr]
        names = _names(file, numbers)
        check_size(path, sum(file.groups[at].channel_group.cycles_nr for at in numbers))
        tables = [_table(path, file, at, names[at], wanted) for at in numbers]

    if not tables:
        raise RigFileError(f"{path}: found no samples; expected an MDF file with some")
    return tables


def _names(file: Any, numbers: list[int]) -> dict[int, str]:
    """A name for each group: its own where no other has it, else with its number."""
    own = {at: getattr(file.groups[at].channel_group, "acq_name", "") or "" for at in numbers}
    given = list(own.values())
    alone = {at: name for at, name in own.items() if name and given.count(name) == 1}
    return {at: alone.get(at, f"{own[at] or 'group'}[{at}]") for at in numbers}


def _table(path: Path, file: Any, at: int, group: str, wanted: Wanted) -> SeriesTable:
    arrays, units = {}, {}
    master = file.masters_db.get(at)
    for index, channel in enumerate(file.groups[at].channels):
        name = f"{group}.{channel.name}"
        if index == master or not wanted.has(name, group):
            continue
        signal = file.get(group=at, index=index, ignore_invalidation_bits=False)
        values = np.asarray(signal.samples)
        if values.ndim == 1 and values.dtype.names is None:
            arrays[name], units[name] = values, str(signal.unit or "")

    begins = round(file.start_time.timestamp()) if file.start_time else 0
    clock = max(begins, 0) * NS + since(file.get_master(at))
    return table(path, arrays, group, units, clock)
