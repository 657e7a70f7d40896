"""The bed in the bin, on disk: what its runs know together, from one run of the daemon to the next.

`bed.json` in the folder of the logs. A bed that is replaced keeps its file under its own name.
"""

from __future__ import annotations

import json
import math
import os
import stat
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config.names import is_file_name
from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bank import Bank, reported
from gritd.estimator.filter.bounds import Bounds
from gritd.estimator.filter.estimate import STATES, Estimate, Vector, covariance, made
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.filter.tuning import FORM, TRUST
from gritd.estimator.online.bed import (
    Known,
    RunStart,
    after_run,
    before_run,
    fingerprint,
    variances_of,
)
from gritd.estimator.online.sound import unsound
from gritd.estimator.terramechanics.soil import Array

FILE = "bed.json"
DATE = "%Y-%m-%d %H:%M:%S UTC"
SEAL = "crc32"  # entry: of all the others
MAX_BYTES = 1 << 20  # a bed takes a hundredth of it
UNNAMED = "unnamed"  # a bed begun in the place of one that cannot be read
# [σ of the prior] that an error which all runs share may be off. The filter finds truths up to
# ten σ off its prior (TrustTuning.doubt); beyond, it sets itself back, and the run adds nothing.
FARTHEST = 10.0
ROUNDING = 1e-6  # relative; no measurement widens what is known of a shared error
LATEST = 1e10  # [s since the epoch], in the year 2286
MOST_RUNS = 10**6


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
        return _read(_unsealed(json.loads(_text(path))))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise BedError(f"{path}: {(error.strerror or 'cannot read').lower()}") from None
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        raise BedError(f"{path}: is no file of a bed; `gritd bed new NAME` begins one") from None


def save(folder: Path, bed: Bed) -> None:
    """Put the bed into the bin, whole or not at all. Raises BedError."""
    path = path_of(folder)
    new = path.with_suffix(".new")

    try:
        with new.open("w", encoding="utf-8") as file:
            json.dump(_sealed(_plain(bed)), file, indent=1)
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


def anew(folder: Path, settings: Settings, now: float) -> Bed:
    """A new bed in the place of one that cannot be used, on disk if that is possible."""
    name = settings.bed.name or UNNAMED
    try:
        return begin(folder, name, now)
    except BedError:  # it is tried again at the end of the run
        return Bed(name, now)


def useless(bed: Bed, settings: Settings, now: float) -> str:
    """Why a run on the bed begins with the stated prior; '' where it begins with what is known."""
    if bed.known is None:
        return "no run on it yet"
    age = now - bed.updated
    if abs(age) > settings.bed.stale_after:
        hours = f"{abs(age) / 3600.0:.0f} h"
        return f"its last run was {hours} ago" if age > 0.0 else f"its last run is {hours} ahead"
    if bed.rig != fingerprint(settings):
        return "prior, calibration, filter or effects have changed since"
    return _impossible(bed.known.bank, settings)


def _impossible(bank: Bank, settings: Settings) -> str:
    """What of a bank no run can have left by these settings; '' for nothing."""
    prior = Tracker(settings).prior_bank
    if [len(member.x) for member in bank] != [len(member.x) for member in prior]:
        return "it holds other quantities than this filter"

    mean, sigma = prior[0].x[:STATES], np.sqrt(np.diag(covariance(prior[0]))[:STATES])
    bounds = Bounds(settings, mean, tuple(sigma.tolist()))
    if any(bounds.inside(member).x != member.x for member in bank):
        return "it holds a soil outside the bounds of the filter"
    preparation = np.array(variances_of(settings.bed.repeatability))
    if not all(map(_narrower, bank, prior)) or not _credible(
        reported(bank), prior[-1], preparation
    ):
        return "it holds values that no run leaves"
    return ""


def _narrower(member: Estimate, prior: Estimate) -> bool:
    """Whether a run may have left its σ: nothing of the soil is exact, and no error that all runs
    share is known less well than before any run.
    """
    variance, before = np.diag(covariance(member)), np.diag(covariance(prior))
    exact = np.any(variance[:STATES] <= 0.0)
    return not exact and bool(np.all((variance <= before * (1.0 + ROUNDING))[STATES:]))


def _credible(known: Estimate, prior: Estimate, preparation: Array) -> bool:
    """Whether what all members say together is what the filter itself would believe: soil no wider
    than TrustTuning.wider allows, no shared error farther from its prior than the filter goes. (A
    single member that does not fit the record takes errors of any size, and counts nothing.)

    preparation: variances (3,).
    """
    variance, before = np.diag(covariance(known)), np.diag(covariance(prior))
    widest = TRUST.wider**2 * before[:STATES] + preparation
    off = np.abs(np.array(known.x) - np.array(prior.x))
    near = off <= FARTHEST * np.sqrt(before) * (1.0 + ROUNDING)
    return bool(np.all(variance[:STATES] <= widest) and np.all(near[STATES:]))


def start_of(bed: Bed, settings: Settings, now: float) -> RunStart | None:
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


def _text(path: Path) -> str:
    """Of a regular file, without waiting for a pipe. Raises OSError, ValueError."""
    with open(path, "rb", opener=_at_once) as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise ValueError("no regular file")
        data = stream.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError("too long")
    return data.decode()


def _at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


def _sealed(plain: Mapping[str, Any]) -> dict[str, Any]:
    """With a checksum: a digit that changed on the disk must not pass for what a run knows."""
    return {**plain, SEAL: zlib.crc32(json.dumps(plain).encode())}


def _unsealed(sealed: dict[str, Any]) -> dict[str, Any]:
    """Raises ValueError where it is not what was sealed."""
    plain = {key: value for key, value in sealed.items() if key != SEAL}
    if sealed != _sealed(plain):
        raise ValueError("not what was written")
    return plain


def _read(plain: Mapping[str, Any]) -> Bed:
    """Raises ValueError, KeyError, TypeError where it is no bed."""
    (updated,) = _vector([plain["updated"]])
    bed = Bed(plain["name"], updated, None, str(plain["rig"]))
    if not bed.name or not is_file_name(bed.name) or not 0.0 <= updated <= LATEST:
        raise ValueError("no name or time of a bed")
    if "runs" not in plain:
        return bed
    if not 1 <= int(plain["runs"]) <= MOST_RUNS:
        raise ValueError("no number of runs")
    bank = tuple([_member(member) for member in plain["members"]])
    if len(bank) != len(FORM.sizes) or len({len(member.x) for member in bank}) != 1:
        raise ValueError("not what a run leaves")
    return replace(bed, known=Known(bank, int(plain["runs"])))


def _member(plain: Mapping[str, Any]) -> Estimate:
    """Raises ValueError where it is no estimate."""
    x, P = _vector(plain["x"]), np.array([_vector(row) for row in plain["P"]])
    (evidence,) = _vector([plain["log_evidence"]])
    if P.shape != (len(x), len(x)):
        raise ValueError("not an estimate")
    member = made(x, P, evidence)
    if wrong := unsound(member):
        raise ValueError(wrong)
    return member


def _vector(values: Any) -> Vector:
    vector = tuple(float(value) for value in values)
    if not all(map(math.isfinite, vector)):
        raise ValueError("not finite")
    return vector
