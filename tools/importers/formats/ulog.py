"""ULog, as PX4 writes it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import check_size, reading, table
from gritd.tools.importers.series.columns import SeriesTable, Wanted

CLOCK = "timestamp"  # [us] since the start of the flight computer


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The fields of each message, `message.field`, an element of an array `message.q[0]`; a second
    sensor's messages are `message:1`. The clock is each message's own. Raises RigFileError.
    """
    with reading(path, "a ULog file"):
        messages = import_module("pyulog").ULog(str(path)).data_list
    check_size(path, sum(len(each) for message in messages for each in message.data.values()))

    tables = [_table(path, message, wanted) for message in messages if len(message.data[CLOCK])]
    if not tables:
        raise RigFileError(f"{path}: found no messages; expected a ULog file with some")
    return tables


def _table(path: Path, message: Any, wanted: Wanted) -> SeriesTable:
    group = message.name + (f":{message.multi_id}" if message.multi_id else "")
    named = {f"{group}.{field}": values for field, values in message.data.items()}
    chosen = {name: values for name, values in named.items() if wanted.has(name, group)}
    return table(path, chosen, group, clock=message.data[CLOCK].astype(np.int64) * 1000)
