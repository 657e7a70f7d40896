"""What `gritd estimate` and the filter say of a bench's tables, and how it compares with the truth.

The tables go through `gritd import series` in another process, as a user's would.
"""

from __future__ import annotations

import json
import subprocess
import sys
from math import inf, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gritd.estimator.config.configuration import loads
from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.status import UPDATED, Flag
from gritd.estimator.offline.batch import estimates
from gritd.estimator.offline.playback import without_absent
from gritd.estimator.recording.salvage import Recording, read
from gritd.tools.cli.command import FAILED, CommandError
from gritd.tools.proof.online.draw import CHANGES, Bench, SoilChange
from gritd.tools.proof.online.drive import driven, share
from gritd.tools.proof.online.exact import sigma_of_c
from gritd.tools.proof.online.hand import CONFIGURATION, MAP, write

GRITD = (sys.executable, "-m", "gritd")
FLAGS = Flag.MISMATCH | Flag.RESET | Flag.CHANGED | Flag.PRIOR


class Score(NamedTuple):
    """One bench; errors in σ."""

    stratum: str
    believed: bool
    c: float
    tan_phi: float
    nees: float  # of c and tan φ, 2 degrees of freedom
    sigma_c: float  # [Pa]
    exact_sigma_c: float  # [Pa] of a fit that knows the form
    first: float  # [s] of driving until the first belief of a single run; inf where there is none
    changes: int  # said where the soil did not change
    hours: float  # in which it did not
    silent: float  # share of the time after a change beyond 3σ without a flag
    reason: str


def handed_over(bench: Bench, folder: Path) -> float:
    """Drive the bench and write its tables; σ of c of the exact fit [Pa]."""
    tables = driven(bench)
    write(bench, tables, folder)
    return nan if bench.stratum in CHANGES else sigma_of_c(bench, tables)


def estimate_of(folder: Path) -> dict[str, Any]:
    """What `gritd estimate` says of the tables in a folder. Raises CommandError."""
    tables = [str(path) for path in sorted(folder.glob("run_*.csv"))]
    stated = folder / CONFIGURATION
    config = ["--config", str(stated)] if stated.exists() else []
    out = folder / "out"
    last = (out / Path(tables[-1]).name).with_suffix(".mcap")
    _called(last, "import", "series", *tables, "--map", str(folder / MAP), *config, "-o", str(out))

    recordings = [str(path) for path in sorted(out.glob("run_*.mcap"))]
    found = folder / "estimate.json"
    _called(found, "estimate", *recordings, "--json", str(found))  # exit 1 where it is not sure
    result: dict[str, Any] = json.loads(found.read_text(encoding="utf-8"))
    return result


def _called(makes: Path, *arguments: str) -> None:
    """Raises CommandError where the command does not make what it should."""
    done = subprocess.run((*GRITD, *arguments), capture_output=True, text=True, check=False)
    if not makes.exists():
        reason = done.stderr.strip().splitlines()[-1:] or ["nothing was said"]
        raise CommandError(f"gritd {arguments[0]}: exit {done.returncode}: {reason[0]}", FAILED)


def scored(bench: Bench, folder: Path, exact: float) -> Score:
    """The bench opened: what was said of it compared with the truth."""
    found = estimate_of(folder)
    together, ground = found["together"], bench.ground
    sigma = np.array([together["c"]["sigma"], together["tan_phi"]["sigma"]])
    error = np.array(
        [together["c"]["value"] - ground.cohesion, together["tan_phi"]["value"] - ground.tan_phi]
    )
    z, rho = error / sigma, together["correlation"]
    nees = float(z @ np.linalg.solve([[1.0, rho], [rho, 1.0]], z))

    followed = _followed(bench, folder)
    return Score(
        bench.stratum,
        bool(found["believed"]),
        float(z[0]),
        float(z[1]),
        nees,
        float(sigma[0]),
        exact,
        *followed,
        found["reason"],
    )


def _followed(bench: Bench, folder: Path) -> tuple[float, int, float, float]:
    """first, changes, hours, silent of a `Score`."""
    first, changes, hours, silent = inf, 0, 0.0, nan
    for path, run in zip(sorted((folder / "out").glob("run_*.mcap")), bench.runs, strict=True):
        recording = read(path)
        rows = estimates(_settings(recording), recording)
        time = (rows["evaluated"] - rows["evaluated"][0]) / NS
        flags = rows["flags"].astype(int)
        first = min(first, _first(rows, time))

        if run.course is None:
            changes += int(np.sum(np.diff((flags & Flag.CHANGED > 0).astype(int)) > 0))
            hours += float(time[-1]) / 3600.0
        else:
            began = float(recording.arrays("/raw/wheel_encoder")["stamp"][0])
            silent = _silent(bench, run.course, rows, (rows["evaluated"] - began) / NS)
    return first, changes, hours, silent


def _settings(recording: Recording) -> Settings:
    settings = loads(recording.config_yaml or "", str(recording.path)).settings
    return settings_of_run(without_absent(settings, recording), recording.run)


def _first(rows: Any, time: Any) -> float:
    """Driving time [s] until an estimate is believed whose σ of tan φ is half of the prior's."""
    sigma = rows["tan_phi_sigma"]
    narrow = (rows["updates"] > 0) & (sigma < 0.5 * sigma[0]) & (rows["flags"] & Flag.PRIOR == 0)
    return float(time[int(np.argmax(narrow))]) if narrow.any() else inf


def _silent(bench: Bench, course: SoilChange, rows: Any, time: Any) -> float:
    """Share of the driving time after the change beyond 3σ without a flag."""
    done = share(course, time)
    c = bench.ground.cohesion * (1.0 + (course.cohesion - 1.0) * done)
    tan_phi = bench.ground.tan_phi * (1.0 + (course.tan_phi - 1.0) * done)
    away = np.maximum(
        np.abs(rows["cohesion"] - c) / rows["cohesion_sigma"],
        np.abs(rows["tan_phi"] - tan_phi) / rows["tan_phi_sigma"],
    )

    after = (time >= course.begin) & np.isin(rows["status"], [int(each) for each in UPDATED])
    quiet = (rows["flags"].astype(int) & FLAGS) == 0
    return float(np.mean((away > 3.0)[after] & quiet[after])) if after.any() else 0.0
