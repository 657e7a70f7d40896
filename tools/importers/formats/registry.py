"""The formats of files that hold time series, by what a file begins with, else by its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gritd.estimator.recording.mcapfile import opened
from gritd.tools.cli.optional import require
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats import hdf5, lvm, mat, mdf, npz, parquet, ros, tdms, ulog, xlsx
from gritd.tools.importers.series.columns import SeriesTable, Wanted


@dataclass(frozen=True)
class Format:
    """One kind of file.

    endings: of a file's name, small. marks: how its bytes begin. package: what it is read with.
    """

    endings: tuple[str, ...]
    read: Callable[[Path, Wanted], list[SeriesTable]]
    marks: tuple[bytes, ...] = ()
    package: str = ""


FORMATS = (
    Format((".parquet",), parquet.read, (b"PAR1",), "pyarrow"),
    Format((".h5", ".hdf5", ".hdf", ".he5", ".nc"), hdf5.read, (b"\x89HDF\r\n",), "h5py"),
    Format((".mat",), hdf5.read, (b"MATLAB 7.3",), "h5py"),
    Format((".mat",), mat.read, (b"MATLAB 5.0",)),
    Format((".npz", ".npy"), npz.read, (b"\x93NUMPY",)),
    Format((".tdms",), tdms.read, (b"TDSm",), "nptdms"),
    Format((".xlsx", ".xlsm", ".xls", ".xlsb", ".ods"), xlsx.read, (), "python_calamine"),
    Format((".ulg",), ulog.read, (b"ULog\x01",), "pyulog"),
    Format((".mf4", ".mdf"), mdf.read, (b"MDF     ", b"UnFinMF "), "asammdf"),
    Format((".lvm",), lvm.read, (lvm.BEGINS.encode(),)),
    Format((".mcap",), ros.read_mcap, (b"\x89MCAP0\r\n",), "rosbags"),
    Format((".bag",), ros.read_bag, (b"#ROSBAG V",), "rosbags"),
    Format((".db3",), ros.read_bag, (b"SQLite format 3\x00",), "rosbags"),
)
ENDINGS = tuple(dict.fromkeys(ending for each in FORMATS for ending in each.endings))
LONGEST = max(len(mark) for each in FORMATS for mark in each.marks)


def format_of(path: Path) -> Format | None:
    """The kind of a file; None for a text. Raises RigFileError where it cannot be read."""
    if path.is_dir():
        return next(each for each in FORMATS if each.read is ros.read_bag)
    try:
        with opened(path) as file:
            begins = file.read(LONGEST)
    except OSError as error:
        raise RigFileError(f"{path}: cannot be read: {error.strerror or error}") from None

    marked = [each for each in FORMATS if begins.startswith(each.marks)]
    named = [each for each in FORMATS if path.name.lower().endswith(each.endings)]
    return next(iter(marked or reversed(named)), None)


def read(path: Path, wanted: Wanted) -> list[SeriesTable] | None:
    """The tables of a file that is no text; None for a text. Raises RigFileError; CommandError
    where what reads it is not installed.
    """
    form = format_of(path)
    if form is None:
        return None
    if form.package:
        require(form.package, str(path))
    return form.read(path, wanted)
