"""The bed in the bin, on disk: what its runs know together, from one run of the daemon to the next.

`bed.json` in the folder of the logs. A bed that is replaced keeps its file under its own name.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bank import Bank
from gritd.estimator.filter.estimate import STATES, Estimate, Vector, made
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.filter.tuning import FORM
from gritd.estimator.online.bed import Known, Start, after_run, before_run, fingerprint

FILE = "bed.json"
DATE = "%Y-%m-%d %H:%M:%S UTC"


class BedError(Exception):
    """The file of the bed cannot be read or written: one line."""


@dataclass(frozen=True)
class Bed:
    """A prepared bed and what is known of it."""

    name: str
    updated: float  # [s since the epoch]
    known: Known | None = None  # None before its first run
    rig: str = ""  # fingerprint of the settings that `known` holds for

    @property
    def runs(self) -> int:
        return 0 if self.known is None else self.known.runs


def path_of(folder: Path) -> Path:
    """Where the bed of a log folder stands."""
    return folder / FILE


def load(folder: Path) -> Bed | None:
    """The bed in the bin; None where none was named. Raises BedError."""
    path = path_of(folder)
    try:
        return _read(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise BedError(f"{path}: {(error.strerror or 'cannot read').lower()}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise BedError(f"{path}: is no file of a bed; `gritd bed new NAME` begins one") from None


def save(folder: Path, bed: Bed) -> None:
    """Put the bed into the bin, whole or not at all. Raises BedError."""
    path = path_of(folder)
    new = path.with_suffix(".new")

    try:
        with new.open("w", encoding="utf-8") as file:
            json.dump(_plain(bed), file, indent=1)
            file.write("\n")
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as error:
        raise BedError(f"{path}: {(error.strerror or 'cannot write').lower()}") from None


def begin(folder: Path, name: str, now: float) -> Bed:
    """A new bed in the bin; the one before keeps its file under its name and date. Raises
    BedError.
    """
    path = path_of(folder)
    try:
        if path.exists():
            date = time.strftime("%Y%m%d-%H%M%S", time.gmtime(path.stat().st_mtime))
            path.replace(path.with_name(f"bed-{_name_of(path)}-{date}.json"))
    except OSError as error:
        raise BedError(f"{path}: {(error.strerror or 'cannot rename').lower()}") from None

    bed = Bed(name, now)
    save(folder, bed)
    return bed


def _name_of(path: Path) -> str:
    try:
        return load(path.parent).name  # type: ignore[union-attr]  # it exists
    except BedError:
        return "unreadable"


# --- a run ---


def current(folder: Path, settings: Settings, now: float) -> Bed | None:
    """The bed that a run is driven on: the configured one, begun anew where the bin holds another,
    or the one in the bin. None without either. Raises BedError.
    """
    bed = load(folder)
    name = settings.bed.name
    if name and (bed is None or bed.name != name):
        return begin(folder, name, now)
    return bed


def useless(bed: Bed, settings: Settings, now: float) -> str:
    """Why a run on the bed begins with the stated prior; '' where it begins with what is known."""
    if bed.known is None:
        return "no run on it yet"
    age = now - bed.updated
    if age > settings.bed.stale_after:
        return f"its last run was {age / 3600.0:.0f} h ago"
    if bed.rig != fingerprint(settings):
        return "prior, calibration, filter or effects have changed since"
    return ""


def start_of(bed: Bed, settings: Settings, now: float) -> Start | None:
    """What a run begins with; None for the stated prior."""
    if bed.known is None or useless(bed, settings, now):
        return None
    return before_run(bed.known, settings.bed.repeatability)


def after(bed: Bed, settings: Settings, left: Bank, began: float, now: float) -> Bed:
    """The bed after a run that began at a time and left a bank.

    began, now: [s since the epoch].
    """
    known = bed.known
    if known is None or useless(bed, settings, began):
        known = Known(Tracker(settings).prior_bank, 0)
    learnt = after_run(known, left, settings.bed.repeatability)
    return replace(bed, known=learnt, updated=now, rig=fingerprint(settings))


# --- the file ---


def _plain(bed: Bed) -> dict[str, Any]:
    plain: dict[str, Any] = {"name": bed.name, "updated": bed.updated, "rig": bed.rig}
    if bed.known is not None:
        members = [
            {"x": member.x, "P": member.P, "log_evidence": member.log_evidence}
            for member in bed.known.bank
        ]
        plain |= {"runs": bed.known.runs, "members": members}
    return plain


def _read(plain: Mapping[str, Any]) -> Bed:
    """Raises ValueError, KeyError, TypeError where it is no bed."""
    bed = Bed(str(plain["name"]), float(plain["updated"]), None, str(plain["rig"]))
    if "runs" not in plain:
        return bed
    bank = tuple([_member(member) for member in plain["members"]])
    if len(bank) != len(FORM.sizes) or len({len(member.x) for member in bank}) != 1:
        raise ValueError("not what a run leaves")
    return replace(bed, known=Known(bank, int(plain["runs"])))


def _member(plain: Mapping[str, Any]) -> Estimate:
    """Raises ValueError where the covariance is none."""
    x, P = _vector(plain["x"]), np.array([_vector(row) for row in plain["P"]])
    (evidence,) = _vector([plain["log_evidence"]])
    if len(x) < STATES or P.shape != (len(x), len(x)) or not np.array_equal(P, P.T):
        raise ValueError("not an estimate")

    # a covariance, to rounding; a parameter that is exact has a variance of zero
    scale = np.sqrt(np.maximum(np.diag(P), 0.0))
    unit = P / np.outer(scale + (scale == 0.0), scale + (scale == 0.0))
    if np.any(np.diag(P) < 0.0) or float(np.linalg.eigvalsh(unit)[0]) < -1e-9:
        raise ValueError("not a covariance")
    return made(x, P, evidence)


def _vector(values: Any) -> Vector:
    vector = tuple(float(value) for value in values)
    if not all(map(math.isfinite, vector)):
        raise ValueError("not finite")
    return vector
