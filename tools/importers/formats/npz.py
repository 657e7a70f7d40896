"""NumPy's .npz and .npy."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.formats.made import by_length, check_size, reading, spread
from gritd.tools.importers.series.columns import SeriesTable, Wanted


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The vectors by name; a column of a matrix is `x[0]`, a field of records `x.name`. What a .npy
    holds is called by the file. Raises RigFileError.
    """
    with reading(path, "a file of numpy.save or numpy.savez, without Python objects"):
        content = np.load(path, mmap_mode="r", allow_pickle=False)
        if isinstance(content, np.ndarray):
            whole = {path.stem: content}
        else:
            with content:
                whole = _loaded(path, content, wanted)

    arrays: dict[str, Any] = {}
    for name, values in whole.items():
        arrays |= spread(name, values)
    return by_length(path, arrays)


def _loaded(path: Path, content: Any, wanted: Wanted) -> dict[str, Any]:
    """The arrays that are wanted; without those of Python objects, which nobody should load."""
    check_size(path, sum(entry.file_size for entry in content.zip.infolist()) // 8)
    arrays = {}
    for name in filter(wanted.touches, content.files):
        with suppress(ValueError):
            if isinstance(values := content[name], np.ndarray):  # not of what else is in a zip
                arrays[name] = values
    return arrays
