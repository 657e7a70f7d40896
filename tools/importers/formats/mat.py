"""MATLAB files: up to version 7 by scipy, later ones as the HDF5 that they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import by_length, check_size, reading, spread
from gritd.tools.importers.series.columns import SeriesTable, Wanted

EXPECTED = "a MATLAB file"


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The vectors, also those inside structures, as `s.name`; a table for each length of them.
    Raises RigFileError.
    """
    vectors = _vectors("", _content(path))
    if not vectors:
        raise RigFileError(
            f"{path}: found no vector; expected columns of time series; of a table or timetable "
            "save table2struct(T, 'ToScalar', true)"
        )
    check_size(path, sum(values.size for values in vectors.values()))
    return by_length(path, vectors)


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
    with reading(path, f"{EXPECTED}, version 7 or older"):
        check_size(path, sum(math.prod(shape) for _, shape, _ in scipy_io.whosmat(path)))
        content: dict[str, Any] = scipy_io.loadmat(path, squeeze_me=True, simplify_cells=True)
    return content


def _vectors(prefix: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Vectors of a structure, and the columns of its matrices as `name[1]`, `name[2]` …"""
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, Mapping):
            vectors |= _vectors(f"{prefix}{name}.", value)
        elif isinstance(value, np.ndarray):
            vectors |= spread(f"{prefix}{name}", value, first=1)
        elif isinstance(value, list):  # a list of structures: `runs[1].t`
            named = {f"{name}[{at}]": item for at, item in enumerate(value, start=1)}
            vectors |= _vectors(prefix, {k: v for k, v in named.items() if isinstance(v, Mapping)})

    return {name: values for name, values in vectors.items() if values.size > 1}
