"""HDF5, and the MATLAB files of version 7.3 that are HDF5 too."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import by_length, check_size, common, reading, spread
from gritd.tools.importers.series.columns import SeriesTable, Wanted

UNITS = ("units", "unit", "Units", "Unit", "UNIT")  # attributes that name a unit
OF_MATLAB = "MATLAB_class"  # an attribute of every variable of a MATLAB file
OPAQUE = "tables and timetables of MATLAB, which others cannot read"
INSTEAD = "structures, as table2struct(T, 'ToScalar', true) makes them"


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The vectors by their path, `group.name`, a table for each length of them. A column of a
    matrix is `x[0]`, in a MATLAB file `x[1]`; a field of records `x.name`. Raises RigFileError.
    """
    with reading(path, "an HDF5 file"), import_module("h5py").File(path, "r") as file:
        found = dict(_datasets(file))
        chosen = {name: data for name, data in found.items() if _is_wanted(name, found, wanted)}
        check_size(path, sum(data.size for data in chosen.values()))

        arrays: dict[str, Any] = {}
        units: dict[str, str] = {}
        for name, data in chosen.items():
            own = _spread(name, data)
            arrays |= own
            units |= dict.fromkeys(own, _unit(data))
        opaque = not arrays and _has_opaque(file)

    if opaque:
        raise RigFileError(f"{path}: found {OPAQUE}; expected {INSTEAD}")
    return by_length(path, arrays, {name: unit for name, unit in units.items() if unit})


def _is_wanted(name: str, found: dict[str, Any], wanted: Wanted) -> bool:
    """By the whole path or by its last part, also where only a part of it is asked for."""
    if wanted.touches(name) or wanted.touches(name.rpartition(".")[2]):
        return True
    prefix = common(list(found))
    return wanted.touches(name.removeprefix(f"{prefix}."))


def _datasets(file: Any) -> Iterator[tuple[str, Any]]:
    """What may hold series, by its path with dots, in the order of the file."""
    h5py = import_module("h5py")
    places: list[tuple[str, Any]] = []
    file.visititems(lambda name, item: places.append((name, item)))

    for name, item in places:
        if name.startswith("#") or not isinstance(item, h5py.Dataset):
            continue
        path = name.replace("/", ".")
        if h5py.check_ref_dtype(item.dtype):
            yield from _referred(file, path, item)
        elif item.size and not _is_text(item):
            yield path, item


def _referred(file: Any, path: str, item: Any) -> Iterator[tuple[str, Any]]:
    """The vectors behind a field of an array of structures: `runs[1].t`."""
    parent, _, field = path.rpartition(".")
    for at, reference in enumerate(np.ravel(item[()]), start=1):
        target: Any = file[reference] if reference else None
        if hasattr(target, "dtype") and target.size and not _is_text(target):
            yield (f"{parent}[{at}].{field}" if parent else f"{field}[{at}]"), target


def _is_text(item: Any) -> bool:
    """A text of MATLAB, an empty array or an object: no series."""
    kind = item.attrs.get(OF_MATLAB, b"")
    return (
        kind in (b"char", b"cell")
        or "MATLAB_object_decode" in item.attrs
        or bool(item.attrs.get("MATLAB_empty", 0))
    )


def _has_opaque(file: Any) -> bool:
    return any("MATLAB_object_decode" in item.attrs for item in file.values())


def _spread(name: str, data: Any) -> dict[str, Any]:
    """The series of one dataset."""
    h5py = import_module("h5py")
    values = data.asstr()[()] if h5py.check_string_dtype(data.dtype) else data[()]
    values = np.squeeze(np.asarray(values))
    own = spread(name, values, first=1 if OF_MATLAB in data.attrs else 0)
    return {key: each for key, each in own.items() if each.size > 1}


def _unit(data: Any) -> str:
    """The unit that an attribute names."""
    for name in UNITS:
        text = data.attrs.get(name, "")
        if isinstance(text, bytes | str):
            text = text.decode(errors="replace") if isinstance(text, bytes) else text
            if text:
                return str(text)
    return ""
