"""Runs as a lab book has them: what was driven, and what the equations say beside it."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.filter.estimate import soil as soil_of
from gritd.estimator.messages.status import UPDATED
from gritd.estimator.offline.bed_runs import BedRun, bed_runs
from gritd.estimator.offline.playback import without_absent
from gritd.estimator.recording.recording import Recording
from gritd.estimator.terramechanics import linear, original
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.cli.wording import NOTHING, fixed
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.rig.signals import is_drive, read_all
from gritd.tools.recordings.summary import RunSummary, summary
from gritd.tools.report import front, masthead

NS = 1e-9
UNDATED = 978_307_200_000_000_000  # [ns] 2001: files that do not say when begin before
PIECE = 1 << 20  # [bytes] that are hashed at once
ANOTHER_LOAD = 0.05  # relative gap between the windows of two loads
FEWEST = 5  # windows of a load


@dataclass(frozen=True)
class Beside:
    """Measured beside the equations at the windows (n,) at which the filter was updated."""

    slip: Array
    load: Array  # [N]
    measured: dict[str, Array]  # torque [N·m], drawbar_pull [N]
    original: dict[str, Array]  # by Eqs. (1)-(10), with the modulus that carries the load
    closed: dict[str, Array]  # by Eqs. (20)-(22)

    def off(self, channel: str, which: str) -> float:
        """Mean |difference| from what was measured, as a share of the mean measured size; NaN where
        the channel was not measured.
        """
        measured, computed = self.measured[channel], getattr(self, which)[channel]
        good = np.isfinite(measured)
        if not good.any():
            return float("nan")
        size = np.mean(np.abs(measured[good]))
        return float(np.mean(np.abs(computed[good] - measured[good])) / size)

    def at(self, index: NDArray[np.intp]) -> Beside:
        """Some of the windows (n,)."""
        forces = (self.measured, self.original, self.closed)
        chosen = ({name: values[index] for name, values in each.items()} for each in forces)
        return Beside(self.slip[index], self.load[index], *chosen)

    def by_load(self) -> list[Beside]:
        """The windows of each load that was driven, the lightest first; what lies between two
        loads for a few windows alone is a change of load, and left out.
        """
        order = np.argsort(self.load)
        apart = np.diff(self.load[order]) > ANOTHER_LOAD * self.load[order][:-1]
        groups = np.split(order, np.flatnonzero(apart) + 1)
        kept = [g for g in groups if len(g) >= FEWEST] or [order]
        return [self.at(np.sort(group)) for group in kept]


@dataclass(frozen=True)
class LabRun:
    """One run."""

    run: BedRun
    summary: RunSummary
    sha256: str
    beside: Beside | None  # None where the filter was never updated

    @property
    def name(self) -> str:
        return self.run.recording.run.name or self.run.recording.path.stem

    @property
    def rows(self) -> np.ndarray:
        """Windows (n,), fields of /tick."""
        return self.run.carried.rows


def lab_runs(runs: Sequence[BedRun]) -> list[LabRun]:
    """The runs of a bed, their equations at what all of them know of its soil."""
    final = runs[-1].known.estimate
    return [
        LabRun(run, summary([run.recording]), sha256(run.recording), beside(run, final))
        for run in runs
    ]


def sha256(recording: Recording) -> str:
    """Of the file."""
    digest = hashlib.sha256()
    with recording.path.open("rb") as file:
        while piece := file.read(PIECE):
            digest.update(piece)
    return digest.hexdigest()


def beside(run: BedRun, estimate: Estimate) -> Beside | None:
    """Both forms of the equations at the windows of a run, at an estimate of the soil."""
    rows = run.carried.rows
    rows = rows[np.isin(rows["status"], UPDATED) & (rows["theta_1"] > 0.0)]
    if not len(rows):
        return None

    slip, load, theta_1 = (np.asarray(rows[name]) for name in ("slip", "load", "theta_1"))
    measured = {name: np.asarray(rows[name]) for name in ("torque", "drawbar_pull")}
    return Beside(
        slip,
        load,
        measured,
        _original(run.settings, estimate, theta_1, slip, load),
        _closed(run.settings, estimate, theta_1, slip, load),
    )


def _original(
    settings: Settings, estimate: Estimate, theta_1: Array, slip: Array, load: Array
) -> dict[str, Array]:
    """T and DP (n,) of Eqs. (8)-(10). Both follow the sinkage modulus in a straight line, so it is
    taken as that which carries the load at the measured entry angle.
    """
    c, tan_phi, k = soil_of(estimate)
    modulus = settings.soil.pressure_sinkage.modulus(settings.wheel.width)
    none, stated = (
        original.forces(
            settings.wheel,
            Soil(c, tan_phi, k, settings.soil.exponent.value, value),
            theta_1,
            slip,
        )
        for value in (0.0, modulus)
    )
    share = (load - none.load) / (stated.load - none.load)

    def at_load(name: str) -> Array:
        low, high = getattr(none, name), getattr(stated, name)
        return np.asarray(low + share * (high - low))

    return {name: at_load(name) for name in ("torque", "drawbar_pull")}


def _closed(
    settings: Settings, estimate: Estimate, theta_1: Array, slip: Array, load: Array
) -> dict[str, Array]:
    """T and DP (n,) of Eqs. (20) and (22) with σₘ from (21), without any correction."""
    c, tan_phi, k = soil_of(estimate)
    states = zip(theta_1.tolist(), slip.tolist(), load.tolist(), strict=True)
    at = [
        linear.forces_under_load(settings.wheel, c, tan_phi, k, angle, i, weight)
        for angle, i, weight in states
    ]
    return {name: np.array([getattr(f, name) for f in at]) for name in ("torque", "drawbar_pull")}


# --- the table of runs ---

HEAD = ("run", masthead.DATE, "load [N]", "slip [%]", "duration [s]", "SHA-256")


def table_of(runs: Iterable[LabRun]) -> list[list[str]]:
    """A row a run, as HEAD names the columns."""
    return [
        [
            run.name,
            _date(run.summary.start),
            loads_of(run),
            _slips(run.beside),
            fixed(run.summary.duration, 1),
            run.sha256[:12],
        ]
        for run in runs
    ]


def loads_of(run: LabRun) -> str:
    """The load [N] that is stated of a run; else those that were measured."""
    if run.run.recording.run.nominal_load is not None or run.beside is None:
        return f"{run.run.settings.load.nominal.value:g}"
    return ", ".join(fixed(float(np.mean(part.load)), 0) for part in run.beside.by_load())


def _date(stamp: int) -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.gmtime(stamp * NS)) if stamp > UNDATED else NOTHING


def _slips(of: Beside | None) -> str:
    if of is None:
        return NOTHING
    low, high = np.quantile(of.slip, (0.02, 0.98)) * 100.0
    return f"{fixed(float(low), 0)} … {fixed(float(high), 0)}"


def records_of(runs: Sequence[LabRun]) -> list[dict[str, str]]:
    """The same rows by the names of the columns, with operator and notes of each run."""
    return [
        dict(zip(HEAD, row, strict=True)) | _remarks(run)
        for run, row in zip(runs, table_of(runs), strict=True)
    ]


def _remarks(run: LabRun) -> dict[str, str]:
    info = run.run.recording.run
    return {masthead.OPERATOR: info.operator, masthead.NOTES: info.notes}


def with_runs(
    diagnosis: Diagnosis, paths: Sequence[Path], configuration: Configuration
) -> Diagnosis:
    """With the rig and the table of runs that its report begins with; a drive without soil has
    none. Raises CommandError for a file that cannot be read.
    """
    recordings = read_all(paths)
    if is_drive(recordings):
        return diagnosis

    settings = configuration.settings
    given = ((settings_of_run(without_absent(settings, r), r.run), r) for r in recordings)
    runs = lab_runs(list(bed_runs(given, settings.bed.repeatability)))

    told = {front.RIG: settings.testbed, front.RUNS: records_of(runs)}
    return replace(diagnosis, redo={**diagnosis.redo, **told})
