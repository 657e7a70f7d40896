"""The adapter for a motor drive without soil: T = J dω/dt + B ω, and whatever of the library acts on a drivetrain.

The same engine, effects and statistics as for a wheel. The library's expected sizes are those of a small wheel, so an
effect sees torques in units of the drive's own, `unit` newton metres, and speeds in units of its usual speed; what is
said is in newton metres and radians a second again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_filter

from estimator.effects import EFFECTS
from estimator.effects.base import Effect
from estimator.forward import drive
from estimator.settings import Settings
from estimator.situation import Sensed, Situation
from estimator.terramechanics.soil import Array
from tools.diagnose.load import Series
from tools.diagnose.rig import Known, Run

RATE = 50.0  # [Hz]
FINE = 250.0  # [Hz] on which position and current are averaged before they are filtered
WINDOW = 17  # fine samples of the one filter of position and current: 68 ms
USUAL = 2.0  # size that the drive's torque has in units of `unit`: that of the wheel the priors were made for
STILL = 0.05  # share of the usual speed below which friction's direction is open
EFFECTS_OF_A_DRIVE = (
    "coulomb_friction", "asymmetric_friction", "stribeck_friction", "gear_ripple", "motor_heating", "current_offset",
    "sensor_latency",
)  # fmt: skip
UNITS = {
    "torque": "N·m", "speed": "rad/s", "acceleration": "rad/s²", "position": "rad", "wheel_angle": "rad", "time": "s",
    "heat": "A²·s", "direction": "-", "run": "-", "constant": "-", "slip": "-", "load": "N", "sinkage": "m",
}  # fmt: skip


class DriveRig:
    """See rig.Rig."""

    channels = ("torque",)
    units: Mapping[str, str] = UNITS
    smooth = (("speed",), ("velocity",), ("acceleration",), ("wheel_angle",), ("velocity", "acceleration"))
    baseline: tuple[Effect, ...] = ()

    def __init__(self, series: Sequence[Mapping[str, Series]], names: Sequence[str], settings: Settings) -> None:
        self.settings = settings
        self.caveats: list[str] = ["A drive without soil: inertia and viscous friction are the base model."]
        self._motions = [_motion(s, settings.drive.torque_constant.value) for s in series]
        self.unit = float(np.sqrt(np.mean(np.concatenate([m["torque"] for m in self._motions]) ** 2))) / USUAL
        speed = np.abs(np.concatenate([m["velocity"] for m in self._motions]))
        self.usual = float(np.median(speed[speed > 0.05 * speed.max()]))  # [rad/s]
        self.constants = (
            Known("inertia", *self._guess("acceleration"), "kg·m²"),
            Known("damping", *self._guess("speed"), "N·m·s/rad"),
        )
        self.effects = {n: EFFECTS[n] for n in EFFECTS_OF_A_DRIVE}
        self.runs = [self._run(m, n) for m, n in zip(self._motions, names, strict=True)]

    def _guess(self, name: str) -> tuple[float, float]:
        """A constant that is not known: nothing, give or take what would take all of the torque."""
        size = np.sqrt(
            np.mean(np.concatenate([m["velocity" if name == "speed" else name] for m in self._motions]) ** 2)
        )
        return 0.0, float(10.0 * USUAL * self.unit / size)

    def predict(self, u: Array, effects: Sequence[Effect]) -> list[dict[str, Array]]:
        inertia, damping = (k.of(float(x)) / self.unit for k, x in zip(self.constants, u, strict=True))
        return [self._predict(m, inertia, damping, effects) for m in self._motions]

    def _predict(
        self, motion: Mapping[str, Array], inertia: float, damping: float, effects: Sequence[Effect]
    ) -> dict[str, Array]:
        zero = np.zeros(motion["time"].size)
        situation = Situation(
            time=motion["time"], wheel_angle=motion["angle"], wheel_speed=motion["velocity"] / self.usual,
            wheel_acceleration=motion["acceleration"], carriage_speed=zero, position=motion["angle"], pass_number=1.0,
            radius=1.0, width=1.0, slip=zero, direction=np.sign(motion["velocity"]), load=zero,
        )  # fmt: skip
        torque = inertia * motion["acceleration"] + damping * motion["velocity"]
        situation, _ = drive(replace(situation, torque=torque), effects, 1.0)
        sensed = Sensed(zero, situation.current, zero, zero, torque)
        for effect in effects:
            sensed = effect.sensors(sensed, situation)
        return {"torque": np.asarray(sensed.current) * self.unit}

    def stated(self, unit: str) -> float:
        """Factor from a parameter of the library to what it means for this drive."""
        if unit == "rad/s":
            return self.usual
        return self.unit if unit in ("N·m", "A") else 1.0

    def _run(self, motion: Mapping[str, Array], name: str) -> Run:
        velocity = motion["velocity"]
        ones = np.ones(velocity.size)
        covariates = {
            "speed": np.abs(velocity), "velocity": velocity, "acceleration": motion["acceleration"],
            "wheel_angle": motion["angle"], "position": motion["angle"], "time": motion["time"],
            "heat": np.cumsum(motion["torque"] ** 2) / RATE, "direction": np.tanh(velocity / (STILL * self.usual)),
            "constant": ones,
        }  # fmt: skip
        moving = np.abs(velocity) > STILL * self.usual
        return Run(name, motion["time"], {"torque": motion["torque"]}, {"torque": moving}, covariates)


def _motion(series: Mapping[str, Series], constant: float) -> dict[str, Array]:
    """Position, its derivatives and the torque on the grid, all through one filter, so that none lags another."""
    time, angle = series["wheel_encoder"]
    current_time, current = series["motor_shunt"]
    fine = np.arange(
        max(time[0], current_time[0]) + 1.0 / FINE, min(time[-1], current_time[-1]) - 1.0 / FINE, 1.0 / FINE
    )
    angle, current = _averaged(fine, time, angle), _averaged(fine, current_time, current)

    smooth = savgol_filter(angle, WINDOW, 3)
    velocity = np.gradient(smooth, 1.0 / FINE)
    kept = slice(WINDOW, -WINDOW, round(FINE / RATE))
    return {
        "time": fine[kept] - fine[0],
        "angle": smooth[kept],
        "velocity": velocity[kept],
        "acceleration": np.gradient(velocity, 1.0 / FINE)[kept],
        "torque": savgol_filter(current, WINDOW, 3)[kept] * constant,
    }


def _averaged(fine: Array, time: Array, values: Array) -> Array:
    """Values at the fine grid, each the mean over one of its intervals."""
    total = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
    edges = np.concatenate((fine - 0.5 / FINE, fine[-1:] + 0.5 / FINE))
    return np.asarray(np.diff(np.interp(edges, time, total)) * FINE)
