"""Parquet files."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import MOST_COLUMNS, check_size, reading, table
from gritd.tools.importers.series.columns import SeriesTable, Wanted


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The columns; a field of a structure is `s.name`, an element of a list `x[0]`. Raises
    RigFileError.
    """
    with reading(path, "a Parquet file"):
        file = import_module("pyarrow.parquet").ParquetFile(path)
        names = [name for name in file.schema_arrow.names if wanted.touches(name)]
        check_size(path, file.metadata.num_rows * max(len(names), 1))
        content = file.read(names or None)
        arrays = dict(pair for name in names for pair in _flat(name, content.column(name)))

    if not file.metadata.num_rows:
        raise RigFileError(f"{path}: found no rows; expected columns of time series")
    return [table(path, arrays)]


def _flat(name: str, values: Any) -> Iterator[tuple[str, Any]]:
    """A column of plain values, or those of its parts."""
    types = import_module("pyarrow.types")
    if types.is_struct(values.type):
        array = values.combine_chunks()
        for field, part in zip(values.type, array.flatten(), strict=True):
            yield from _flat(f"{name}.{field.name}", part)
    elif types.is_list(values.type) or types.is_fixed_size_list(values.type):
        yield from _elements(name, values)
    else:
        yield name, values.to_numpy(zero_copy_only=False)


def _elements(name: str, values: Any) -> Iterator[tuple[str, Any]]:
    """The elements of a column of lists; none where they are longer than sets of channels are."""
    compute = import_module("pyarrow.compute")
    most = compute.max(compute.list_value_length(values)).as_py() or 0
    if most > MOST_COLUMNS:
        return
    rows = values.to_pylist()
    for at in range(most):
        yield f"{name}[{at}]", _padded(rows, at)


def _padded(rows: list[Any], at: int) -> Any:
    """One element of each list (n,), None where it has fewer."""
    return np.array([row[at] if row and len(row) > at else None for row in rows], dtype=object)
