"""A pair of campaigns as a paper prints them: the steady state of every stretch, a row each, and
nothing of the course.

The tables go to `gritd import table`, as those of a laboratory would.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.tools.proof.blind.campaign import BlindRun, DrivenStretch
from gritd.tools.proof.blind.detect import BlindTrial, Detector, undisturbed
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.whitening import RATE, Signals

IMPORT = (sys.executable, "-m", "gritd", "import", "table")
SOILS = "soils.csv"
SETTLED = 0.35  # of a stretch, after which it is steady
ERRORS = (0.01, 0.04)  # of a channel's root mean square: as well as figures are read and repeat
CONSTANTS = ("source", "wheel_radius_m", "wheel_width_m", "soil_simulant")
COLUMNS = {"pull": "drawbar_pull_n", "sinkage": "sinkage_m", "torque": "torque_nm"}
STATED = {"pull": "drawbar-pull", "sinkage": "sinkage", "torque": "torque"}
SOIL = "simulant,n,k_c_kN_per_m_n_plus_1,k_phi_kN_per_m_n_plus_2,cohesion_kPa,friction_angle_deg"


def steady(run: BlindRun, time: Array) -> Iterator[tuple[DrivenStretch, NDArray[np.bool_]]]:
    """Each stretch of a run and where it is steady (n,); time: since the run began [s]."""
    begins = 0.0
    for stretch in run.stretches:
        ends = begins + stretch.duration
        yield stretch, (time >= begins + SETTLED * stretch.duration) & (time < ends - run.ramp)
        begins = ends


def errors_drawn(trial: BlindTrial, rng: np.random.Generator) -> dict[str, float]:
    """Standard deviation of a printed value [SI], by channel."""
    bare = undisturbed(trial)
    sizes = {n: np.concatenate([_read(f, trial)[n] for f in bare]) for n in COLUMNS}
    return {
        name: float(rng.uniform(*ERRORS) * np.sqrt(np.mean(values**2)))
        for name, values in sizes.items()
    }


class PrintedDetector(Detector):
    """What the printed rows of a campaign can show."""

    def _whitened(self, signals: Signals) -> Array:
        """Rows of all channels and runs over their errors (m,)."""
        trial, rows = self._trial, []
        for run, read in zip(trial.runs, signals, strict=True):
            torque = read["current"] * trial.known.torque_constant.value
            time = np.arange(torque.size) / RATE
            for name, values in {**read, "torque": torque}.items():
                if name in trial.printed:
                    rows += [values[at].mean() / trial.printed[name] for _, at in steady(run, time)]
        return np.array(rows)


def write(
    felt: Mapping[str, tuple[BlindTrial, Sequence[Felt]]], noise_factor: float, seed: int, to: Path
) -> Path:
    """Tables of campaigns, by name, in to/tables, and what `gritd import table` makes of them in
    to/imported, which is returned. Raises OSError, CalledProcessError.
    """
    tables, imported = to / "tables", to / "imported"
    tables.mkdir(parents=True)
    rng = np.random.default_rng((seed, 4))
    for name, (trial, runs) in felt.items():
        text = "\n".join(_table(trial, runs, rng))
        (tables / f"{name}.csv").write_text(text + "\n", encoding="utf-8")
    (tables / SOILS).write_text(_soils(trial), encoding="utf-8")

    heaviest = max(run.weight for run in trial.runs)
    options = [f"--load-sigma={trial.known.weight_share * heaviest:.3g}"]
    options += [f"--soil-strength={'table' if seed % 2 else 'unknown'}"]
    for name, sigma in trial.printed.items():
        options.append(f"--{STATED[name]}-sigma={noise_factor * sigma:.3g}")
    command = [*IMPORT, str(tables), "-o", str(imported), *options]
    subprocess.run(command, check=True, capture_output=True)
    return imported


def _table(trial: BlindTrial, felt: Sequence[Felt], rng: np.random.Generator) -> Iterator[str]:
    """Its lines."""
    measured = [f"meas_{column}" for column in COLUMNS.values()]
    yield ",".join((*CONSTANTS, "soil_shear_modulus_k_m", "vertical_load_n", "slip", *measured))
    known = trial.known
    wheel = f"blind,{known.radius!r},{known.width!r},soil,{known.soil['shear_modulus'].value:.5f}"
    for run, one in zip(trial.runs, felt, strict=True):
        time = one.scene.motion.time - one.scene.motion.time[0]
        read = _read(one, trial)
        for stretch, at in steady(run, time):
            values = [
                float(read[name][at].mean() + trial.printed[name] * rng.standard_normal())
                for name in COLUMNS
            ]
            cells = (f"{value:.4g}" for value in values)
            yield ",".join((wheel, f"{stretch.weight:.1f}", f"{stretch.slip:.3f}", *cells))


def _read(felt: Felt, trial: BlindTrial) -> dict[str, Array]:
    """Channels (n,) of a table: the torque is the motor's."""
    torque = felt.current * trial.known.torque_constant.value
    return {"pull": felt.pull, "sinkage": felt.sinkage, "torque": torque}


def _soils(trial: BlindTrial) -> str:
    soil = {name: stated.value for name, stated in trial.known.soil.items()}
    modulus, cohesion = 1e-3 * soil["modulus"], 1e-3 * soil["cohesion"]
    angle = math.degrees(math.atan(soil["tan_phi"]))
    return f"{SOIL}\nsoil,{soil['exponent']:.4f},0,{modulus:.3f},{cohesion:.4f},{angle:.3f}\n"
