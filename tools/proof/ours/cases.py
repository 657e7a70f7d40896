"""Fresh cases from our own simulator, for measuring the diagnosis: drawn testbeds, soils,
schedules, noise and effects.

Signals are made without a file: simulated at 250 Hz, counted and quantised as the sensors do, noise
white and coloured, then averaged by the loader's own functions. Their truth stays with them. The
sealed proof uses another plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config.settings import Calibration, Settings, Uncertain
from gritd.estimator.effects.base import Effect
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.offline.windows import block_bend, block_mean, block_slope
from gritd.estimator.stages.history import delayed
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.noise.colour import Colour
from gritd.tools.diagnose.rig.full_rate import FullRate, beside_lines
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import Signals, doubt
from gritd.tools.diagnose.rig.wheel import Bed, wheel_rig
from gritd.tools.proof.ours.coloured import coloured
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from gritd.tools.testbed.simulation import soil_of

RATE, GRID = 250.0, 10.0  # [Hz]
SECONDS = 28.0  # a run
PAUSE = 60.0  # [s] from the start of one run to the next
NOISE = {
    "sinkage": 5e-5,
    "current": 4e-3,
    "drawbar_pull": 0.3,
    "load": 0.3,
    "axle_torque": 0.02,
}  # one reading
QUANTUM = {
    "sinkage": 1.9e-6,
    "current": 1.5e-4,
    "drawbar_pull": 0.01,
    "load": 0.01,
    "axle_torque": 1e-3,
}


@dataclass(frozen=True)
class Plan:
    """What is driven, and how noisy it is; everything of a case but soil and effects."""

    settings: Settings
    soil: Soil  # true
    motions: tuple[Motion, ...]
    weights: tuple[float | None, ...]  # nominal load as the run states it
    noise: float  # factor on NOISE
    slow: float  # size of coloured noise relative to white, one reading
    slow_time: float  # [s]
    wrench: bool
    errors: dict[
        str, tuple[float, float]
    ]  # of calibration, by channel: relative error of the scale, zero error
    weight_errors: tuple[float, ...]  # relative, of each run's weights
    seed: int


def draw(settings: Settings, rng: np.random.Generator) -> Plan:
    """A testbed, a soil inside what is known of it, a schedule; noise of any colour."""
    settings = _known(settings, rng)
    count = int(rng.integers(4, 8))
    loads = rng.permutation(np.linspace(rng.uniform(30, 45), rng.uniform(80, 110), count))
    speed = rng.uniform(0.012, 0.03)
    motions, began = [], 0.0
    for number in range(count):
        motions.append(_motion(settings, rng, float(loads[number]), speed, began))
        began += PAUSE

    return Plan(
        settings,
        _soil(settings, rng),
        tuple(motions),
        tuple(float(x) for x in loads),
        float(np.exp(rng.uniform(-0.7, 0.7))),
        float(rng.choice([0.0, 0.1, 0.3])),
        float(rng.choice([0.05, 0.3, 1.0, 3.0])),
        bool(rng.random() < 0.8),
        _errors(settings, rng),
        tuple(
            (rng.standard_normal() + _set_errors(loads, rng))
            * np.sqrt(0.5)
            * _relative(settings.load.nominal)
        ),
        int(rng.integers(1 << 31)),
    )


def _set_errors(loads: Array, rng: np.random.Generator) -> Array:
    """What the weights of each run are off by for themselves, in σ; one load is one set of
    weights.
    """
    drawn = rng.standard_normal(loads.size)
    return drawn if np.ptp(loads) > 0.0 else np.full(loads.size, drawn[0])


def _known(settings: Settings, rng: np.random.Generator) -> Settings:
    """Another soil and wheel, known as well as a bevameter knows them."""
    wheel = replace(settings.wheel, radius=float(rng.uniform(0.06, 0.15)))
    wheel = replace(wheel, width=float(wheel.radius * rng.uniform(0.8, 1.3)))

    prior = settings.soil
    cohesion, tan_phi, k = rng.uniform(200, 1500), rng.uniform(0.45, 0.75), rng.uniform(0.01, 0.03)
    soil = replace(
        prior,
        cohesion=Uncertain(float(cohesion), float(cohesion * rng.uniform(0.2, 0.4))),
        tan_phi=Uncertain(float(tan_phi), float(tan_phi * rng.uniform(0.04, 0.1))),
        shear_modulus=Uncertain(float(k), float(0.1 * k)),
        exponent=Uncertain(float(rng.uniform(0.9, 1.2)), 0.01),
        modulus_sigma=0.05,
    )
    return replace(settings, wheel=wheel, soil=soil, effects=())


def _errors(settings: Settings, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """Calibrations off within what the configuration says of them."""
    known: dict[str, Calibration] = {
        "sinkage": settings.channels["sinkage_pot"].calibration,
        "current": settings.channels["motor_shunt"].calibration,
    }
    if (wrench := settings.wrench) is not None:
        known |= {
            "drawbar_pull": wrench.drawbar_pull,
            "load": wrench.load,
            "axle_torque": wrench.torque,
        }

    return {
        name: (
            float(_relative(c.scale) * rng.standard_normal()),
            float(c.offset.sigma * rng.standard_normal()),
        )
        for name, c in known.items()
    }


def _relative(known: Uncertain) -> float:
    return known.sigma / abs(known.value) if known.value else 0.0


def _soil(settings: Settings, rng: np.random.Generator) -> Soil:
    prior = settings.soil
    values = {
        name: max(known.value + known.sigma * float(rng.standard_normal()), 0.1 * known.value)
        for name in ("cohesion", "tan_phi", "shear_modulus", "exponent")
        if (known := getattr(prior, name)) is not None
    }
    return soil_of(
        settings,
        {**values, "modulus_factor": float(np.exp(prior.modulus_sigma * rng.standard_normal()))},
    )


def _motion(
    settings: Settings, rng: np.random.Generator, load: float, speed: float, began: float
) -> Motion:
    slips = rng.permutation([0.05, 0.15, 0.3, 0.45, 0.6])[: int(rng.integers(3, 6))]
    rest = Segment(2.0, load, float(slips[0]), 0.0)
    each = (SECONDS - rest.duration) / len(slips)

    driven = [
        Segment(each, load, float(s), float(speed * rng.choice([0.5, 1.0, 1.6]))) for s in slips
    ]
    if rng.random() < 0.5:  # it stops at the end, and at times on the way
        driven.append(replace(rest, duration=1.5))
        if rng.random() < 0.4:
            driven.insert(len(driven) // 2, replace(rest, duration=1.5))

    motion = motion_of(
        Schedule((rest, *driven), float(rng.uniform(0.3, 0.9))),
        settings.wheel.radius, RATE, float(rng.integers(1, 4)), float(rng.choice([0.0, 0.15, 0.3])),
    )  # fmt: skip
    return replace(motion, time=np.asarray(motion.time) + began)


def record(plan: Plan, acting: Sequence[Effect], noisy: bool = True) -> list[Signals]:
    """What the sensors send, on the grid."""
    return [signals for signals, _ in record_fully(plan, acting, noisy)]


def record_fully(
    plan: Plan, acting: Sequence[Effect], noisy: bool = True
) -> list[tuple[Signals, FullRate]]:
    """What the sensors send, on the grid and at their own rate."""
    rng = np.random.default_rng(plan.seed)
    return [_recorded(plan, number, acting, rng, noisy) for number in range(len(plan.motions))]


def rig_of(
    plan: Plan,
    acting: Sequence[Effect],
    reference: Sequence[tuple[Signals, FullRate]] = (),
    bed: Bed = "prepared",
) -> Rig:
    """The rig of a case, its ripples given at full rate. reference: runs with nothing new."""
    every = [*reference, *record_fully(plan, acting)]
    signals, full = zip(*every, strict=True)

    reads = [lambda read=read: read for read in full]
    constant, count = plan.settings.drive.torque_constant.value, len(reference)
    beside, lines = beside_lines(signals, reads, constant, count)
    return wheel_rig(beside, plan.settings, count, bed, lines=lines)


def _recorded(
    plan: Plan, number: int, acting: Sequence[Effect], rng: np.random.Generator, noisy: bool
) -> tuple[Signals, FullRate]:
    motion, settings = plan.motions[number], plan.settings
    servo = replace(
        _servo(motion, rng), load=np.asarray(motion.load) * (1.0 + plan.weight_errors[number])
    )
    response = simulate_arrays(
        settings.wheel,
        plan.soil,
        servo,
        acting,
        torque_constant=settings.drive.torque_constant.value,
    )

    time = np.asarray(motion.time)
    edges = time[0] + np.arange(int((time[-1] - time[0]) * GRID) + 1) / GRID
    angle = _counted(np.asarray(servo.wheel_angle), 9.58738e-5, rng)
    wheel = block_slope(time, angle, edges)
    travel = np.asarray(servo.carriage_position) / settings.pulley_radius
    carriage = block_slope(time, _counted(travel, 7.669904e-4, rng), edges)

    sensed = response.sensed
    channels = {"sinkage": sensed.sinkage, "current": sensed.current}
    if plan.wrench:
        channels |= {
            "drawbar_pull": sensed.drawbar_pull,
            "load": sensed.load,
            "axle_torque": sensed.torque,
        }
    read = {
        name: (time, _read(plan, name, np.asarray(value), rng, noisy))
        for name, value in channels.items()
    }
    analogue = {name: block_mean(*values, edges) for name, values in read.items()}

    info = RunInfo(
        name=f"run{number + 1}",
        nominal_load=plan.weights[number],
        pass_number=int(np.max(motion.pass_number)),
        start_position=float(np.max(motion.start_position)),
    )

    middle = 0.5 * (edges[1:] + edges[:-1]) - edges[0]
    signals = Signals(
        info.name,
        info,
        float(edges[0]),
        middle,
        *wheel[:2],
        block_bend(time, angle, edges),
        *carriage[:2],
        doubt(wheel, carriage),
        analogue,
    )
    return signals, {"wheel_encoder": (time, angle), **read}


def _servo(motion: Motion, rng: np.random.Generator) -> Motion:
    """Speeds follow what is asked, wheel and carriage each with a lag of its own, as servos do."""
    time = np.asarray(motion.time)
    wheel, carriage = (
        np.asarray(delayed(time, speed, float(rng.uniform(0.01, 0.06))))
        for speed in (motion.wheel_speed, motion.carriage_speed)
    )

    step = 1.0 / RATE
    return replace(
        motion,
        wheel_speed=wheel,
        carriage_speed=carriage,
        wheel_angle=np.cumsum(wheel) * step,
        carriage_position=np.cumsum(carriage) * step,
    )


def _counted(values: Array, quantum: float, rng: np.random.Generator) -> Array:
    counts: Array = (
        np.floor(values / quantum + rng.uniform() + 0.2 * rng.standard_normal(values.size))
        * quantum
    )
    return counts


def _read(plan: Plan, name: str, values: Array, rng: np.random.Generator, noisy: bool) -> Array:
    if not noisy:
        return values
    sigma = NOISE[name] * plan.noise

    gaps = np.full(values.size, 1.0 / RATE)
    gaps[0] = np.inf
    slow = (
        coloured(gaps, 1, Colour(plan.slow * sigma, plan.slow_time, 1.0), rng)[:, 0]
        if plan.slow
        else 0.0
    )

    scale, offset = plan.errors.get(name, (0.0, 0.0))
    noise = sigma * rng.standard_normal(values.size) + slow + scale * values + offset
    return np.asarray(np.rint((values + noise) / QUANTUM[name]) * QUANTUM[name])


def scaled(effect: type[Effect], size: float, rng: np.random.Generator) -> Effect:
    """The effect at `size` times its expected strength; bipolar strengths of either sign, shapes
    drawn.
    """
    values = {}
    for p in effect.parameters():
        if p.role == "strength":
            sign = 1.0 if p.low >= p.off else float(rng.choice((-1.0, 1.0)))
            values[p.name] = float(np.clip(p.off + sign * size * p.sigma, p.low, p.high))
        else:
            values[p.name] = float(
                np.clip(p.centre + 0.4 * p.sigma * rng.uniform(-1, 1), p.low, p.high)
            )

    return effect(**values)
