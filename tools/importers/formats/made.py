"""From the arrays that a library gives to tables of time series."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Any, cast

import numpy as np

from gritd.estimator.limits import limits, raised
from gritd.tools.cli.command import CommandError
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.series.columns import Column, SeriesTable
from gritd.tools.importers.series.times import EXACT, NONE, NS, Nanoseconds

FEW = 10  # a shorter vector is no time series where there is a longer one
MOST_COLUMNS = 64  # of a matrix or of a message's array; a longer one is no set of channels
SHOWN = 200  # characters of a library's own message


@contextmanager
def reading(path: Path, expected: str) -> Iterator[None]:
    """Turns what a library raises at a damaged file, a different error for each kind of damage,
    into one line. Raises RigFileError.
    """
    try:
        yield
    except (CommandError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise RigFileError(
            f"{path}: cannot be read: {reason[:SHOWN]}; expected {expected}"
        ) from None


def check_size(path: Path, values: int, limit: str = "series") -> None:
    """Raises RigFileError where more values are read than a log has. limit: `series` of numbers in
    arrays, `values` where each is an object first.
    """
    if values > (most := getattr(limits(), limit)):
        raise RigFileError(f"{path}: found {values} values; expected {most:.0f}; {raised(limit)}")


def table(
    path: Path,
    arrays: Mapping[str, Any],
    group: str = "",
    units: Mapping[str, str] | None = None,
    clock: Nanoseconds | None = None,
) -> SeriesTable:
    """Arrays of one length (n,) by their full names; `clock` as SeriesTable has it."""
    columns = {name: column(values) for name, values in arrays.items()}
    return SeriesTable(path, columns, units=units, group=group, clock=clock)


def by_length(
    path: Path, arrays: Mapping[str, Any], units: Mapping[str, str] | None = None
) -> list[SeriesTable]:
    """Arrays (n,) of any lengths as tables, one a length, in the file's order. Raises RigFileError
    where there are none.
    """
    lengths = {name: len(values) for name, values in arrays.items()}
    most = max(lengths.values(), default=0)
    kept = [length for length in dict.fromkeys(lengths.values()) if length >= min(FEW, most)]
    if most < 2:
        raise RigFileError(f"{path}: found no vector; expected columns of time series")

    made = []
    for length in kept:
        own = {name: values for name, values in arrays.items() if lengths[name] == length}
        made.append(table(path, own, common(list(own)), units))
    return made


def common(names: Sequence[str]) -> str:
    """The path that all names begin with, without its last dot: `s` of s.t and s.x."""
    if len(names) == 1:
        return names[0].rpartition(".")[0]
    parts = [name.split(".")[:-1] for name in names]
    alike = takewhile(lambda level: len(set(level)) == 1, zip(*parts, strict=False))
    return ".".join(level[0] for level in alike)


def column(values: Any) -> Column:
    """Numbers and instants as such, everything else as words. Whole numbers that a float does not
    hold exactly stay as they are: they may be times.
    """
    values = np.asarray(values)
    if values.dtype.kind in "mM":
        instants = values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64)
        instants[np.isnat(values)] = NONE
        return Column(np.where(instants == NONE, np.nan, instants / NS), instants=instants)
    if values.dtype.kind == "i" and values.size and np.max(np.abs(values)) > EXACT:
        return Column(cast(Array, values.astype(np.int64)))
    if values.dtype.kind in "biuf":
        numbers = values.astype(np.float64)
        return Column(np.where(np.isfinite(numbers), numbers, np.nan))
    if values.dtype.kind == "O" and (floats := _numbers(values)) is not None:
        return Column(floats)
    return Column(np.full(values.size, np.nan), [_word(value) for value in values.tolist()])


def since(seconds: Any) -> Nanoseconds:
    """Times [s], shape (n,), in ns; NONE where there is none."""
    values = np.asarray(seconds, np.float64)
    known = np.isfinite(values)
    return np.where(known, np.round(np.where(known, values, 0.0) * NS).astype(np.int64), NONE)


def _numbers(values: Any) -> Array | None:
    """Of objects (n,) that are numbers or nothing; None where any is something else."""
    try:
        return np.array([np.nan if value is None else value for value in values], np.float64)
    except (TypeError, ValueError):
        return None


def _word(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def spread(name: str, values: Any, first: int = 0) -> dict[str, Any]:
    """A vector under its name; the columns of a matrix, or the fields of records, under names of
    their own: `x[0]`, `x[1]`, `x.field`. `first` is the number of the first. Anything else is left
    out.
    """
    if values.dtype.names is not None and values.ndim == 1:
        fields = (spread(f"{name}.{field}", values[field], first) for field in values.dtype.names)
        return {key: value for each in fields for key, value in each.items()}
    if values.ndim == 1:
        return {name: values}
    if values.ndim != 2:
        return {}

    values = values if values.shape[0] >= values.shape[1] else values.T
    if values.shape[1] == 1:
        return {name: values[:, 0]}
    if values.shape[1] > MOST_COLUMNS:
        return {}
    return {f"{name}[{first + at}]": each for at, each in enumerate(values.T)}
