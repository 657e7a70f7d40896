"""The drive: known torques on a lever, the wheel spun in the air, or a torque sensor next to the
motor's current.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.calibrate import creep
from gritd.tools.calibrate.line import Point, fitted
from gritd.tools.calibrate.outcome import CalibratedKey, CalibrationOutcome, residual_table
from gritd.tools.calibrate.plateaus import between, mean_of, plateaus
from gritd.tools.calibrate.sources import CalibrationSource, Signal, series, start_of
from gritd.tools.cli.command import DAMAGED, CommandError

SUMMARY = "torques on a lever, a wheel spun in the air, or a torque sensor: constant and friction"
SHUNT = Signal("motor_shunt", "volts", "V")
WHEEL = Signal("wheel_encoder", "count", "count")
AXLE = Signal("wrench", "ty", "N*m")
CONSTANT = ("drive", "torque_constant")
STILL = 0.02  # of the fastest speed: slower is no turning
SPEEDS = 4  # steady speeds that friction is found from: two, both ways
BLOCK = 1.0  # [s] over which current and torque are compared
READINGS = 20  # of each; a slower log is compared over longer


# --- a lever ---


def by_lever(
    source: CalibrationSource, known: Sequence[Uncertain], settings: Settings
) -> CalibrationOutcome:
    """Torque over current while known torques [N·m] are held. Raises CommandError."""
    line = fitted([_ampere(p, settings) for p in source.points(SHUNT, known)])
    shunt = settings.channels["motor_shunt"].calibration.scale
    relative = shunt.sigma / abs(shunt.value)
    spread = float(np.hypot(line.scale.sigma, line.scale.value * relative))

    return CalibrationOutcome(
        (CalibratedKey(CONSTANT, Uncertain(line.scale.value, spread), "N*m/A"),),
        lines=tuple(residual_table(line, "A", "N*m")),
        warnings=line.warnings,
        fits=(("drive.torque_constant", line),),
    )


def _ampere(point: Point, settings: Settings) -> Point:
    """A shunt's volts as current."""
    known = settings.channels["motor_shunt"].calibration
    current = point.raw.value * known.scale.value + known.offset.value
    return replace(point, raw=Uncertain(current, point.raw.sigma * abs(known.scale.value)))


# --- a wheel in the air ---


@dataclass(frozen=True)
class Spin:
    """One steady speed: wheel [rad/s], and the motor's torque K I [N·m]."""

    speed: float
    torque: Uncertain


def by_spinning(recorded: Recording, settings: Settings) -> CalibrationOutcome:
    """K I = T_C sign ω + B ω + K I₀ over steady speeds both ways, of a wheel without load. Raises
    CommandError.
    """
    spins, notes = _spins(recorded, settings)
    speed = np.array([spin.speed for spin in spins])
    if len(spins) < SPEEDS or not (speed > 0).any() or not (speed < 0).any():
        raise CommandError(
            f"{recorded.path}: found {len(spins)} steady speeds, {int((speed > 0).sum())} of them "
            f"forward; expected two or more each way, {BLOCK:g} s each",
            DAMAGED,
        )

    design = np.column_stack([np.sign(speed), speed, np.ones_like(speed)])
    torque = np.array([spin.torque.value for spin in spins])
    sigma = np.maximum([spin.torque.sigma for spin in spins], 1e-9)
    values, spread, excess = _weighted(design, torque, sigma)

    constant = settings.drive.torque_constant.value
    before = settings.channels["motor_shunt"].calibration.offset.value
    offset = Uncertain(before - values[2] / constant, spread[2] / constant)
    constants = (
        CalibratedKey(("effects", "coulomb_friction", "loss"), _positive(values, spread, 0), "N·m"),
        CalibratedKey(
            ("effects", "viscous_friction", "damping"), _positive(values, spread, 1), "N·m·s/rad"
        ),
        CalibratedKey(("channels", "motor_shunt", "offset"), offset, "A", "A"),
    )
    warnings = list(notes)
    if excess > 3.0:
        warnings.append(f"the speeds scatter {excess:.1f} times more than noise explains")
    if min(values[:2]) < 0.0:
        warnings.append("a friction came out below 0 and is written as 0")

    left = torque - design @ values
    rows = [
        f"{s.speed:+8.4f} rad/s: {s.torque.value:+.4f} ± {s.torque.sigma:.2g} N*m, "
        f"residual {rest:+.4f} N*m"
        for s, rest in zip(spins, left.tolist(), strict=True)
    ]
    return CalibrationOutcome(constants, ("channels", "motor_shunt"), tuple(rows), tuple(warnings))


def _positive(values: Array, spread: Array, at: int) -> Uncertain:
    return Uncertain(max(float(values[at]), 0.0), float(spread[at]))


def _weighted(design: Array, values: Array, sigma: Array) -> tuple[Array, Array, float]:
    """Coefficients, their standard deviations raised where the residuals ask for it, and by how
    much the residuals exceed what is expected.
    """
    covariance = np.linalg.inv(design.T @ (design / sigma[:, None] ** 2))
    coefficients = covariance @ design.T @ (values / sigma**2)
    freedom = values.size - coefficients.size
    left = (values - design @ coefficients) / sigma
    excess = float(np.sqrt((left**2).sum() / freedom)) if freedom > 0 else 0.0
    return coefficients, np.sqrt(np.diag(covariance)) * max(excess, 1.0), excess


def _spins(recorded: Recording, settings: Settings) -> tuple[list[Spin], list[str]]:
    """Stretches of steady speed, without those at rest, and what is to be reported of the current.
    Raises CommandError where it creeps.
    """
    time, speed = _speed(recorded, settings)
    start = _offset(recorded, SHUNT, WHEEL)
    at, current, spiky = _current(recorded, settings)
    at, constant = at + start, settings.drive.torque_constant.value

    spins, held = [], []
    for one in plateaus(time, speed):
        steady = between(at, constant * current, one.begin, one.end)
        if steady and abs(one.mean.value) > STILL * np.abs(speed).max():
            spins.append(Spin(one.mean.value, steady.mean))
            held.append(steady)
    creeping = creep.checked(held, SHUNT.channel, f"{recorded.path}: ")
    return spins, [line for line in (spiky, creeping) if line]


def _speed(recorded: Recording, settings: Settings) -> tuple[Array, Array]:
    """Speed of the wheel [rad/s] in steps of 0.1 s, from the counts at their ends."""
    time, count, _ = series(recorded, WHEEL)
    grid = np.arange(time[0], time[-1], 0.1)
    angle = (
        np.interp(grid, time, count) * settings.channels["wheel_encoder"].calibration.scale.value
    )
    return 0.5 * (grid[1:] + grid[:-1]), np.diff(angle) / 0.1


def _current(recorded: Recording, settings: Settings) -> tuple[Array, Array, str]:
    """Seconds, amperes, and a line on spikes."""
    time, volts, spiky = series(recorded, SHUNT)
    known = settings.channels["motor_shunt"].calibration
    return time, volts * known.scale.value + known.offset.value, spiky


def _offset(recorded: Recording, signal: Signal, other: Signal) -> float:
    """Seconds by which one channel begins after another."""
    return start_of(recorded, signal) - start_of(recorded, other)


# --- a torque sensor ---


def by_sensor(recorded: Recording, settings: Settings) -> CalibrationOutcome:
    """T of the sensor over the motor's current while the wheel drives one way; losses that do not
    change with the torque are in the offset. Raises CommandError.
    """
    at, current, spiky = _current(recorded, settings)
    time, torque, twitchy = series(recorded, AXLE)
    time = time + _offset(recorded, AXLE, SHUNT)
    assert settings.wrench is not None
    torque = torque * settings.wrench.torque.scale.value
    turning = _turning(recorded, settings)

    block = max(BLOCK, READINGS * max(float(np.median(np.diff(t))) for t in (at, time)))
    points, instants = [], []
    for begin in np.arange(time[0], time[-1] - block, block):
        one, other = (_inside(t, v, begin, block) for t, v in ((at, current), (time, torque)))
        if one is not None and other is not None and turning(begin) and turning(begin + block):
            points.append(Point(mean_of(one), mean_of(other)))
            instants.append(begin)
    if len(points) < SPEEDS:
        raise CommandError(
            f"{recorded.path}: found {len(points) * block:g} s of driving with current and "
            "torque; expected some at several loads or slips",
            DAMAGED,
        )

    points, creeping = _without_creep(points, instants)
    line = fitted(points)
    notes = [note for note in (spiky, twitchy, creeping) if note]
    relative = settings.wrench.torque.scale
    spread = float(
        np.hypot(line.scale.sigma, line.scale.value * relative.sigma / abs(relative.value))
    )
    usual = float(np.sqrt((line.expected**2).mean()))
    least, most = torque.min(), torque.max()
    rows = (
        f"{len(points) * block:.0f} s of driving, torque {least:.3g} to {most:.3g} N*m",
        f"residual {line.rms:.3g} N*m r.m.s., {usual:.2g} N*m expected",
        f"the motor's torque is {-line.offset.value:.3g} N*m more than the sensor's at no torque",
    )
    return CalibrationOutcome(
        (CalibratedKey(CONSTANT, Uncertain(line.scale.value, spread), "N*m/A"),),
        lines=rows,
        warnings=(*line.warnings, *notes),
        fits=(("drive.torque_constant", line),),
    )


def _without_creep(points: Sequence[Point], instants: Sequence[float]) -> tuple[list[Point], str]:
    """The points (current, torque) without a torque that creeps with time, and a line on it; as
    they are where it does not matter.
    """
    current, torque = (np.array([getattr(p, n).value for p in points]) for n in ("raw", "known"))
    time = np.array(instants) - np.mean(instants)
    design = np.column_stack([np.ones_like(current), current, time])
    found, left, rank, _ = np.linalg.lstsq(design, torque, rcond=None)
    freedom = torque.size - 3
    if rank < 3 or freedom < SPEEDS:
        return list(points), ""

    variance = float(left[0]) / freedom * np.linalg.inv(design.T @ design)[2, 2]
    part = abs(found[2]) * np.ptp(time) / np.ptp(torque)
    if abs(found[2]) <= creep.SURE * np.sqrt(variance) or part <= creep.HARM:
        return list(points), ""
    taken_out = [
        replace(p, known=replace(p.known, value=p.known.value - found[2] * t))
        for p, t in zip(points, time.tolist(), strict=True)
    ]
    return taken_out, (
        f"current or torque sensor creep by {found[2]:.2g} N*m a second, {100 * part:.1f} % of the "
        "torques in this run; that is taken out"
    )


def _inside(time: Array, values: Array, begin: float, block: float) -> Array | None:
    inside = values[(time >= begin) & (time < begin + block)]
    return inside if inside.size >= 0.9 * READINGS else None


def _turning(recorded: Recording, settings: Settings) -> Callable[[float], bool]:
    """Whether the wheel turns forward at a time of the shunt's."""
    time, speed = _speed(recorded, settings)
    time = time + _offset(recorded, WHEEL, SHUNT)
    least = STILL * np.abs(speed).max()
    return lambda at: float(np.interp(at, time, speed)) > least
