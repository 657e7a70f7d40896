"""Time series in Parquet and MATLAB files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.limits import limits, raised
from gritd.tools.cli.optional import require
from gritd.tools.importers.files import LARGEST, RigFileError
from gritd.tools.importers.series.columns import Column, SeriesTable
from gritd.tools.importers.series.times import NONE, Nanoseconds


def read_parquet(path: Path) -> SeriesTable:
    """The columns of a Parquet file. Raises RigFileError; CommandError without pyarrow."""
    require("pyarrow", str(path))
    try:
        file = import_module("pyarrow.parquet").ParquetFile(path)
        _check_size(path, file.metadata.num_rows * file.metadata.num_columns)
        table = file.read()
    except RigFileError:
        raise
    except Exception as error:  # pyarrow raises a different one for each kind of damage
        raise _unreadable(path, error, "a Parquet file") from None

    return _table(path, {name: table.column(name).to_numpy() for name in table.column_names})


def read_mat(path: Path) -> SeriesTable:
    """The vectors of a MATLAB file up to version 7, also those inside structures, as `s.name`. All
    of the longest length make the table. Raises RigFileError.
    """
    content = _content(path)
    vectors = {name: values for name, values in _vectors("", content).items() if values.size > 1}
    if not vectors:
        raise RigFileError(f"{path}: found no vector; expected columns of time series")
    rows = max(values.size for values in vectors.values())
    return _table(path, {name: v for name, v in vectors.items() if v.size == rows})


def struct_lists(path: Path) -> list[list[Mapping[str, Any]]]:
    """The lists of structures in a MATLAB file, of one structure at least. Raises RigFileError."""
    return [
        list(value)
        for value in _content(path).values()
        if isinstance(value, list | np.ndarray) and len(value) and isinstance(value[0], Mapping)
    ]


def _content(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file. Raises RigFileError."""
    scipy_io = import_module("scipy.io")
    try:
        _check_size(path, sum(math.prod(shape) for _, shape, _ in scipy_io.whosmat(path)))
        content: dict[str, Any] = scipy_io.loadmat(path, squeeze_me=True, simplify_cells=True)
    except RigFileError:
        raise
    except Exception as error:  # scipy raises a different one for each kind of damage
        raise _unreadable(path, error, "a MATLAB file, version 7 or older") from None
    return content


def _vectors(prefix: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Vectors of a structure, and the columns of its matrices as `name[1]`, `name[2]` …"""
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, Mapping):
            vectors |= _vectors(f"{prefix}{name}.", value)
        elif isinstance(value, np.ndarray) and value.ndim == 1:
            vectors[f"{prefix}{name}"] = value
        elif isinstance(value, np.ndarray) and value.ndim == 2 and value.shape[0] > value.shape[1]:
            vectors |= {f"{prefix}{name}[{at + 1}]": column for at, column in enumerate(value.T)}

    return vectors


def _unreadable(path: Path, error: Exception, expected: str) -> RigFileError:
    reason = " ".join(str(error).split())
    return RigFileError(f"{path}: cannot be read: {reason}; expected {expected}")


def _check_size(path: Path, values: int) -> None:
    if values > (most := limits().values):
        raise RigFileError(f"{path}: found more than {most:g} values; {raised('values')}")


def _table(path: Path, arrays: Mapping[str, Any]) -> SeriesTable:
    columns = {name: _column(path, name, values) for name, values in arrays.items()}
    if not columns or not len(next(iter(columns.values())).numbers):
        raise RigFileError(f"{path}: found no rows; expected columns of time series")
    _check_size(path, len(columns) * len(next(iter(columns.values())).numbers))
    return SeriesTable(path, columns)


def _column(path: Path, name: str, values: Any) -> Column:
    """Numbers and instants as numbers, everything else as words."""
    values = np.asarray(values)
    if values.dtype.kind == "M":
        instants = _instants(values)
        return Column(np.where(instants == NONE, np.nan, instants * 1e-9), instants=instants)
    if values.dtype.kind in "biuf":
        numbers = values.astype(np.float64)
        if np.any(np.abs(numbers[np.isfinite(numbers)]) > LARGEST):
            raise RigFileError(f"{path}: {name}: expected numbers up to {LARGEST:g}")
        return Column(np.where(np.isfinite(numbers), numbers, np.nan))
    return Column(np.full(values.size, np.nan), [str(value) for value in values])


def _instants(values: Any) -> Nanoseconds:
    """Since 1970 [ns], shape (n,), NONE where there is none."""
    instants = values.astype("datetime64[ns]").astype(np.int64)
    return np.where(np.isnat(values), NONE, instants)
