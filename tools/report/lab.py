"""Runs as a lab book has them: what was driven, and what the equations say of it."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.filter.estimate import soil as soil_of
from gritd.estimator.messages.status import UPDATED
from gritd.estimator.model.correction import Correction
from gritd.estimator.model.forward import Carried, carried_at, felt
from gritd.estimator.offline.bed_runs import BedRun, bed_runs
from gritd.estimator.offline.playback import without_absent
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.stages.situation import Motion, Reaction
from gritd.estimator.terramechanics import linear
from gritd.estimator.terramechanics.original import OriginalForces
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.cli.wording import NOTHING, fixed
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.rig.signals import is_drive, read_all, sha256
from gritd.tools.recordings.summary import RunSummary, summary
from gritd.tools.report import front, masthead

NS = 1e-9
UNDATED = 978_307_200_000_000_000  # [ns] 2001: files that do not say when begin before
ANOTHER_LOAD = 0.05  # relative gap between the windows of two loads
FEWEST = 5  # windows of a load
CHANNELS = ("torque", "drawbar_pull")


@dataclass(frozen=True)
class MeasuredWindows:
    """Measured against the equations at the windows (n,) at which the filter was updated."""

    slip: Array
    load: Array  # [N]
    measured: dict[str, Array]  # torque [N·m], drawbar_pull [N]
    sigma: dict[str, Array]  # of their noise
    original: dict[str, Array]  # by Eqs. (1)-(10), with the modulus that carries the load
    closed: dict[str, Array]  # by Eqs. (20)-(22)

    def off(self, channel: str, which: str) -> float:
        """Root mean square difference from what was measured [the channel's unit]; NaN where the
        channel was not measured.
        """
        return _rms(getattr(self, which)[channel] - self.measured[channel])

    def noise(self, channel: str) -> float:
        """Root mean square σ of what was measured [the channel's unit]."""
        return _rms(self.sigma[channel])

    def at(self, index: NDArray[np.intp]) -> MeasuredWindows:
        """Some of the windows (n,)."""
        forces = (self.measured, self.sigma, self.original, self.closed)
        chosen = ({name: values[index] for name, values in each.items()} for each in forces)
        return MeasuredWindows(self.slip[index], self.load[index], *chosen)

    def by_load(self) -> list[MeasuredWindows]:
        """The windows of each load that was driven, the lightest first; what lies between two
        loads for a few windows alone is a change of load, and left out.
        """
        order = np.argsort(self.load)
        apart = np.diff(self.load[order]) > ANOTHER_LOAD * self.load[order][:-1]
        groups = np.split(order, np.flatnonzero(apart) + 1)
        kept = [g for g in groups if len(g) >= FEWEST] or [order]
        return [self.at(np.sort(group)) for group in kept]


def joined(parts: Sequence[MeasuredWindows]) -> MeasuredWindows:
    """The windows of several, one after the other."""
    slip, load = (np.concatenate([getattr(p, name) for p in parts]) for name in ("slip", "load"))
    of = ("measured", "sigma", "original", "closed")
    forces = (
        {c: np.concatenate([getattr(part, name)[c] for part in parts]) for c in CHANNELS}
        for name in of
    )
    return MeasuredWindows(slip, load, *forces)


def _rms(values: Array) -> float:
    """Of those (n,) that are known; NaN where none is."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


@dataclass(frozen=True)
class LabRun:
    """One run."""

    run: BedRun
    summary: RunSummary
    sha256: str
    windows: MeasuredWindows | None  # None where the filter was never updated

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
        LabRun(
            run, summary([run.recording]), sha256(run.recording.path), measured_windows(run, final)
        )
        for run in runs
    ]


def measured_windows(run: BedRun, estimate: Estimate) -> MeasuredWindows | None:
    """Both forms of the equations at the windows of a run, at an estimate of the soil, with the
    effects and the discrepancy of the configuration: what `gritd diagnose` simulates, at the
    measured entry angle. None where the filter was never updated.
    """
    rows = run.carried.rows
    needed = ("wheel_speed", "carriage_speed", "load", "theta_1")
    known = np.all([np.isfinite(rows[name]) for name in needed], axis=0)
    rows = rows[known & (rows["theta_1"] > 0.0)]
    used = np.isin(rows["status"], UPDATED)
    if not used.any():
        return None

    original, closed = _both_forms(run.settings, estimate, rows)
    return MeasuredWindows(
        np.asarray(rows["slip"]),
        np.asarray(rows["load"]),
        {name: np.asarray(rows[name]) for name in CHANNELS},
        {name: np.asarray(rows[f"{name}_sigma"]) for name in CHANNELS},
        {name: np.asarray(getattr(original, name)) for name in CHANNELS},
        {name: np.asarray(getattr(closed, name)) for name in CHANNELS},
    ).at(np.flatnonzero(used))


def _both_forms(settings: Settings, estimate: Estimate, rows: Rows) -> tuple[Reaction, Reaction]:
    """What axle and testbed feel by Eqs. (8)-(10) and by Eqs. (20)-(22) at windows (n,)."""
    effects, known = configured(settings.effects), settings.soil
    modulus = known.pressure_sinkage.modulus(settings.wheel.width)
    soil = Soil(*soil_of(estimate), known.exponent.value, modulus)
    learnt = None if settings.discrepancy is None else Correction(settings.discrepancy)

    solved = carried_at(settings.wheel, soil, _motion(settings, rows), effects, rows["theta_1"])
    closed = solved.balance._replace(forces=_closed(solved))
    _, by_original = felt(solved, effects, learnt)
    _, by_closed = felt(replace(solved, balance=closed), effects, learnt)
    return by_original, by_closed


def _motion(settings: Settings, rows: Rows) -> Motion:
    """Of the windows (n,) of one run, the wheel's load in the place of the weights."""
    measured = ("wheel_angle", "wheel_speed", "carriage_speed", "load", "temperature")
    return Motion(
        time=(rows["evaluated"] - rows["evaluated"][0]) * NS,
        carriage_position=rows["carriage_position"] - rows["carriage_position"][0],
        pass_number=float(settings.place.pass_number),
        start_position=settings.place.start_position,
        **{name: np.asarray(rows[name]) for name in measured},
    )


def _closed(solved: Carried) -> OriginalForces:
    """Forces (n,) of Eqs. (20)-(22) with σₘ from (21), at the soil and the motion under the wheel,
    without what contact effects change of the stresses' shape.
    """
    here, theta_1 = solved.situation, solved.balance.theta_1
    c, tan_phi, k, slip, load = (
        np.broadcast_to(np.asarray(value, float), theta_1.shape)
        for value in (here.cohesion, here.tan_phi, here.shear_modulus, here.slip, here.load)
    )
    by = linear.forces_under_load(
        solved.wheel, c, tan_phi, k, theta_1, slip, load, maths=linear.ARRAYS
    )
    forces = (by.drawbar_pull, by.load, by.torque, by.resistance, np.zeros_like(theta_1))
    return OriginalForces(*map(np.asarray, forces))


# --- the table of runs ---

HEAD = ("run", masthead.DATE, "load [N]", "slip [%]", "duration [s]", "SHA-256")


def table_of(runs: Iterable[LabRun]) -> list[list[str]]:
    """A row a run, as HEAD names the columns."""
    return [
        [
            run.name,
            _date(run.summary.start),
            loads_of(run),
            _slips(run.windows),
            fixed(run.summary.duration, 1),
            run.sha256[:12],
        ]
        for run in runs
    ]


def loads_of(run: LabRun) -> str:
    """The load [N] that is stated of a run; else those that were measured."""
    if run.run.recording.run.nominal_load is not None or run.windows is None:
        return f"{run.run.settings.load.nominal.value:g}"
    return ", ".join(fixed(float(np.mean(part.load)), 0) for part in run.windows.by_load())


def _date(stamp: int) -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.gmtime(stamp * NS)) if stamp > UNDATED else NOTHING


def _slips(of: MeasuredWindows | None) -> str:
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

    added = {front.RIG: settings.testbed, front.RUNS: records_of(runs)}
    return replace(diagnosis, redo={**diagnosis.redo, **added})
