"""The adapter for a motor drive without soil: T = J dω/dt + B ω + G sin θ + H cos θ, G and H of a
weight that hangs on it, and whatever of the library acts on a drivetrain.

Position is low-passed and differentiated on a fine grid, the model evaluated there, and prediction
and measured torque low-passed and thinned alike, so that neither noise of the acceleration nor a
lag of a filter is taken for physics: the parallel decimation of Gautier and Poignet (2001), Control
Eng. Practice 9, 1361-1372, which the EMPS benchmark uses.

The same engine, effects and statistics as for a wheel. The library's expected sizes are those of a
small wheel, so an effect sees torques in units of the drive's own, `unit` newton metres, and speeds
in units of its usual speed; what is said is in newton metres and radians a second again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import butter, sosfiltfilt

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import EXPERIMENTS, Effect
from gritd.estimator.limits import limits, raised
from gritd.estimator.model.forward import drive
from gritd.estimator.stages.situation import Balanced, Motion, Sensed, advanced, situation_of
from gritd.estimator.terramechanics.soil import Array, Wheel
from gritd.tools.cli.command import DAMAGED, CommandError
from gritd.tools.diagnose.rig.constants import UNITS as WHEEL_UNITS
from gritd.tools.diagnose.rig.constants import of_channel
from gritd.tools.diagnose.rig.interface import Constant, FormSource, GridRun, Near, Rig, RigWords
from gritd.tools.diagnose.rig.proposals import MENU
from gritd.tools.diagnose.rig.signals import Series
from gritd.tools.diagnose.tuning import TUNING

EFFECTS_OF_A_DRIVE = (
    "coulomb_friction", "asymmetric_friction", "stribeck_friction", "gear_ripple",
    "motor_heating", "current_offset", "sensor_latency",
)  # fmt: skip
# what is nothing without soil
OF_SOIL = (
    "cohesion", "tan_phi", "shear_modulus", "sinkage", "carried", "theta_1", "drawbar_pull",
)  # fmt: skip
CAVEAT = "A drive without soil: inertia, viscous friction and a hanging weight are the base model."
SMOOTH = (
    ("speed",), ("velocity",), ("acceleration",), ("wheel_angle",), ("velocity", "acceleration"),
)  # fmt: skip
MOVED = ("wheel_angle", "velocity", "acceleration")
LOADS = ("inertia", "damping", "weight_sin", "weight_cos")  # torques in proportion to something
NAMED = ("constant", "direction", "velocity", "acceleration")  # what is fitted, or has a name
UNITS = WHEEL_UNITS | {"speed": "rad/s", "position": "rad"}
WITHOUT_SOIL = EXPERIMENTS | {  # what is said in other words of a drive that no wheel is on
    "lifted_spin": "turn the drive at several speeds, both ways, without its load",
    "reversal": "turn the drive back over the same angles at the same speed",
    "speed_step": "step the speed under one load",
    "second_pass": "repeat the same motion",
    "shifted_start": "start at another angle",
}


def drive_rig(
    series: Sequence[Mapping[str, Series]], names: Sequence[str], settings: Settings
) -> Rig:
    """A motor drive of position and current. Raises CommandError where a log is too short."""
    constant = settings.drive.torque_constant.value
    motions = [_motion(s, constant, n) for s, n in zip(series, names, strict=True)]
    unit = _size(m.torque for m in motions) / TUNING.rig.usual_torque
    speed = np.abs(np.concatenate([m.velocity for m in motions]))
    usual = float(np.median(speed[speed > TUNING.rig.creep * speed.max()]))

    model = DriveModel(motions, _constants(motions, unit), unit, usual)
    runs = [_run(m, n, usual) for m, n in zip(motions, names, strict=True)]
    return Rig(
        runs=runs,
        channels=("torque",),
        units=UNITS,
        constants=model.constants,
        effects={n: EFFECTS[n] for n in EFFECTS_OF_A_DRIVE},
        new=[True for _ in names],
        predict=model.predict,
        words=RigWords(
            (CAVEAT,), replace(MENU, driven=(), otherwise="speed_step", said=WITHOUT_SOIL)
        ),
        smooth=SMOOTH,
        forms=(_form(runs),),
        named=[
            [{"torque": r.covariates[n] * (r.covariates["speed"] > 0)} for r in runs] for n in NAMED
        ],
        heated=("torque",),
        filtered=True,
        unit_factors={"rad/s": usual, "N·m": unit, "A": unit / constant},
    )


def _constants(motions: Sequence[DriveMotion], unit: float) -> tuple[Constant, ...]:
    """A constant that is not known is nothing, give or take ten times what would take all of the
    torque.
    """
    most = TUNING.rig.unknown_drive * TUNING.rig.usual_torque * unit
    apart = TUNING.rig.stamps * max(m.sampled for m in motions)
    return (
        Constant("inertia", 0.0, most / _size(m.acceleration for m in motions), "kg·m²"),
        Constant("damping", 0.0, most / _size(m.velocity for m in motions), "N·m·s/rad"),
        Constant("weight_sin", 0.0, most / _size(m.hanging[0] for m in motions), "N·m"),
        Constant("weight_cos", 0.0, most / _size(m.hanging[1] for m in motions), "N·m"),
        of_channel("torque", "delay", apart, "s"),
        of_channel("torque", "blur", apart**2, "s²"),
    )


def _form(runs: Sequence[GridRun]) -> FormSource:
    """Where inertia and friction may not be all: what turns with the drive has a weight and another
    load, so the rest is a smooth function of where it stands and how it moves.
    """
    spread = {n: _size(r.covariates[n] - r.covariates[n].mean() for r in runs) for n in MOVED}
    conditions = [np.column_stack([r.covariates[n] / spread[n] for n in MOVED]) for r in runs]
    turning = [np.where(r.covariates["speed"] > 0.0, 1.0, 0.0) for r in runs]
    return FormSource(
        "drive", ("torque",), tuple(conditions), tuple(turning), drive=True, signed=False
    )


@dataclass(frozen=True, eq=False)
class DriveModel:
    """unit: of torques [N·m]; usual: speed [rad/s]."""

    motions: Sequence[DriveMotion]
    constants: tuple[Constant, ...]
    unit: float
    usual: float

    def predict(
        self,
        u: Array,
        effects: Sequence[Effect],
        in_both: Collection[str] = (),
        near: Near | None = None,
    ) -> list[dict[str, Array]]:
        """Motor torque [N·m]: see interface.Predict."""
        known = {k.name: k.of(float(x)) for k, x in zip(self.constants, u, strict=True)}
        loads = np.array([known[name] for name in LOADS]) / self.unit
        timing = known["torque_delay"], known["torque_blur"]
        torques = [(m, self._torque(m, loads, effects)) for m in self.motions]
        return [{"torque": m.compared(_timed(t, m.step, *timing))} for m, t in torques]

    def _torque(self, motion: DriveMotion, loads: Array, effects: Sequence[Effect]) -> Array:
        """As the current tells it, on the fine grid [N·m]. loads: values (l,) of LOADS."""
        zero = np.zeros(motion.time.size)
        torque = loads @ np.stack((motion.acceleration, motion.velocity, *motion.hanging))
        turning = Motion(
            motion.time,
            motion.angle,
            motion.velocity / self.usual,
            carriage_position=motion.angle,
            carriage_speed=zero,
            load=zero,
            wheel_acceleration=motion.acceleration,
        )
        lifted = situation_of(turning, Wheel(radius=1.0, width=1.0))
        off_soil = advanced(Balanced, lifted, **dict.fromkeys(OF_SOIL, 0.0), torque=torque)
        situation, _ = drive(off_soil, effects, 1.0)

        sensed = Sensed(zero, situation.current, zero, zero, torque)
        for effect in effects:
            sensed = effect.sensors(sensed, situation)
        return np.asarray(sensed.current) * self.unit


def _run(motion: DriveMotion, name: str, usual: float) -> GridRun:
    torque, angle = motion.compared(motion.torque), motion.compared(motion.angle)
    velocity = motion.compared(motion.velocity)
    still = TUNING.rig.creep * usual
    # what holds a drive at rest, half an interval or longer, no law tells; nor what is near it
    moves = maximum_filter1d(np.abs(motion.velocity), motion.every // 2 + 1)
    slowest = minimum_filter1d(moves, 2 * motion.every + 1)[motion.kept]

    covariates = {
        "speed": np.abs(velocity),
        "velocity": velocity,
        "acceleration": motion.compared(motion.acceleration),
        "wheel_angle": angle,
        "position": angle,
        "time": motion.time[motion.kept],
        "heat": np.cumsum(torque**2) * motion.every * motion.step,
        "direction": np.tanh(velocity / still),
        "constant": np.ones(velocity.size),
    }
    return GridRun(
        name,
        motion.time[motion.kept],
        {"torque": torque},
        {"torque": slowest > still},
        covariates,
        np.zeros(velocity.size),
        np.zeros(velocity.size),
    )


@dataclass(frozen=True)
class DriveMotion:
    """A drive's motion and torque on the fine grid, arrays (n,), all through one low-pass: none
    lags another.
    """

    step: float  # [s]
    sampled: float  # [s] sampling interval of the log
    time: Array  # [s]
    angle: Array  # [rad]
    velocity: Array
    acceleration: Array
    torque: Array  # [N·m]

    @property
    def hanging(self) -> Array:
        """Torque of a weight that hangs on the drive, for 1 N·m (2, n): what of it changes as the
        drive turns. What does not is an offset.
        """
        turned = self.angle - self.angle.mean()
        both = np.stack((np.sin(turned), np.cos(turned)))
        return np.asarray(both - both.mean(axis=1, keepdims=True))

    @property
    def every(self) -> int:
        """Fine intervals in one of the comparison."""
        return max(round(1.0 / (TUNING.rig.rate * self.step)), 1)

    @property
    def kept(self) -> slice:
        """The comparison's grid in the fine one."""
        return slice(edge := round(TUNING.rig.log_edge / self.step), -edge, self.every)

    def compared(self, values: Array) -> Array:
        """Values (m,) on the fine grid, low-passed, on the grid of the comparison (n,)."""
        return np.asarray(_low_passed(values, TUNING.rig.band_cutoff / self.every)[self.kept])


def _motion(series: Mapping[str, Series], constant: float, name: str) -> DriveMotion:
    """The fine grid, no finer than the log's own sampling. Raises CommandError where the log is too
    short.
    """
    time, angle = series["wheel_encoder"]
    current_time, current = series["motor_shunt"]
    sampled = max(float(np.median(np.diff(t))) for t in (time, current_time))
    step = max(1.0 / TUNING.rig.fine_rate, sampled)

    begin, end = max(time[0], current_time[0]), min(time[-1], current_time[-1])
    if end - begin < TUNING.rig.shortest_log:
        raise CommandError(
            f"{name}: found {max(end - begin, 0.0):.2f} s of position and current;"
            f" expected {TUNING.rig.shortest_log:g} s",
            DAMAGED,
        )

    most = limits().ticks
    if (end - begin) / step > most:
        raise CommandError(
            f"{name}: found {end - begin:.0f} s of position and current; a drive is followed at"
            f" {1.0 / step:.0f} Hz for {most:.0f} points; {raised('ticks')}",
            DAMAGED,
        )

    fine = np.arange(begin + step, end - step, step)
    smooth = _low_passed(_averaged(fine, step, time, angle), TUNING.rig.sharp_cutoff)
    velocity = _rate(smooth, step)

    mean = _averaged(fine, step, current_time, current)
    torque = constant * _low_passed(mean, TUNING.rig.sharp_cutoff)
    turned = smooth, velocity, _rate(velocity, step)
    return DriveMotion(step, sampled, fine - fine[0], *turned, torque)


def _timed(torque: Array, step: float, delay: float, blur: float) -> Array:
    """As a current that lags by `delay` [s], and was averaged over a window of variance 2 `blur`
    [s²], shows it.
    """
    rate = np.gradient(torque, step)
    return np.asarray(torque - delay * rate + blur * np.gradient(rate, step))


def _rate(values: Array, step: float) -> Array:
    """Derivative by a cubic spline: differences would smooth the acceleration, and nothing else, by
    2 % at 10 Hz.
    """
    time = step * np.arange(values.size)
    return np.asarray(CubicSpline(time, values)(time, 1))


def _low_passed(values: Array, cutoff: float) -> Array:
    """Through a zero-phase Butterworth filter; the cut-off in units of the sampling rate."""
    sections = butter(TUNING.rig.filter_order, 2.0 * cutoff, output="sos")
    return np.asarray(sosfiltfilt(sections, values))


def _averaged(fine: Array, step: float, time: Array, values: Array) -> Array:
    """Values at the fine grid, each the mean over one of its intervals."""
    total = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
    edges = np.append(fine - 0.5 * step, fine[-1] + 0.5 * step)
    return np.asarray(np.diff(np.interp(edges, time, total)) / step)


def _size(values: Iterable[Array]) -> float:
    """Root mean square of all together."""
    return float(np.sqrt(np.mean(np.concatenate(list(values)) ** 2)))
