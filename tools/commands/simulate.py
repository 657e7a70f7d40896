"""`gritd simulate`: the forward model alone, from a schedule to a recording, with the truth in
files beside it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import sqrt
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator import effects
from gritd.estimator.config import configuration as config
from gritd.estimator.config import units
from gritd.estimator.config.effects import quantities
from gritd.estimator.config.schema import Quantity
from gritd.estimator.config.settings import Calibration, Channel, Settings, Wrench
from gritd.estimator.effects.base import Effect
from gritd.estimator.messages.readings import ENCODERS, WRENCH_FIELDS, Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.model.forward import Response, simulate_arrays
from gritd.estimator.offline.measured import measured_run
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.cli.command import DAMAGED, DONE, USAGE, CommandError, Parser, whole
from gritd.tools.cli.files import recording as recorded
from gritd.tools.cli.files import unwritten, vacant
from gritd.tools.testbed import schedule as schedules

START = 1_767_225_600_000_000_000  # [ns] 2026-01-01: a recording made twice is the same to the byte
NS = 1_000_000_000
TRANSPORT = 1_000_000  # [ns] from a stamp to its receipt
ADC_STEPS = 1 << 16  # over the channel's valid range
AMBIENT = 21.0  # [°C]
# [count²] variance of rounding to whole counts; the stated noise of an encoder includes it
ROUNDING = 1.0 / 12.0
SPARSE = 250  # samples from one temperature to the next
SOIL_VALUES = {  # with the bounds that they have in a configuration
    "cohesion": Quantity("Pa", low=0.0, high=1e6),
    "tan_phi": Quantity("", above=0.0, high=5.0),
    "shear_modulus": Quantity("m", above=0.0, high=1.0),
    "exponent": Quantity("", above=0.0, high=5.0),
    "modulus_factor": Quantity("", above=0.0, high=100.0),
}
MOST_SAMPLES = 1_800_000  # 2 h at 250 Hz: the run is made in memory, 1.9 kB a sample


@dataclass(frozen=True)
class Run:
    """A simulated run: what the controller was told, what happened, and what the sensors sent."""

    motion: Motion
    response: Response
    readings: list[Reading]


def simulate_run(
    settings: Settings, soil: Soil, motion: Motion, acting: Sequence[Effect], seed: int
) -> Run:
    """Drive a motion (evenly sampled) and read every configured channel at each of its samples."""
    constant = settings.drive.torque_constant.value
    response = simulate_arrays(settings.wheel, soil, motion, acting, torque_constant=constant)
    return Run(motion, response, readings(settings, motion, response, np.random.default_rng(seed)))


def soil_of(settings: Settings, changed: Mapping[str, float] | None = None) -> Soil:
    """The configured soil, with some of its values replaced; modulus_factor multiplies K."""
    prior, changed = settings.soil, dict(changed or {})
    factor = changed.pop("modulus_factor", 1.0)
    soil = Soil(
        cohesion=prior.cohesion.value,
        tan_phi=prior.tan_phi.value,
        shear_modulus=prior.shear_modulus.value,
        exponent=prior.exponent.value,
        modulus=prior.pressure_sinkage.modulus(settings.wheel.width) * factor,
    )
    return replace(soil, **changed)


# ---- sensors -------------------------------------------------------------------------------------
# ------------------


def readings(
    settings: Settings, motion: Motion, response: Response, rng: np.random.Generator
) -> list[Reading]:
    """What the channels send, in order of receipt: calibration undone, latency, noise, counts and
    ADC steps.
    """
    values = {
        "wheel_encoder": np.asarray(motion.wheel_angle),
        "carriage_encoder": np.asarray(motion.carriage_position) / settings.pulley_radius,
        "sinkage_pot": np.asarray(response.sensed.sinkage),
        "motor_shunt": np.asarray(response.sensed.current),
        "motor_temperature": np.full(np.shape(motion.time), AMBIENT),
    }
    sent = []
    for name, channel in settings.channels.items():
        some = slice(None, None, SPARSE if name == "motor_temperature" else 1)
        sent.append(_channel(channel, np.asarray(motion.time)[some], values[name][some], rng))
    if settings.wrench is not None:
        sent.append(_wrench(settings.wrench, np.asarray(motion.time), response, rng))
    return sorted(
        (reading for channel in sent for reading in channel), key=lambda r: (r.received, r.channel)
    )


def _channel(
    channel: Channel, time: Array, physical: Array, rng: np.random.Generator
) -> Iterable[Reading]:
    counted = channel.name in ENCODERS
    noise = sqrt(max(channel.noise**2 - ROUNDING, 0.0)) if counted else channel.noise
    raw = _raw(channel.calibration, physical) + noise * rng.standard_normal(time.size)
    stamps = _stamps(time, channel.latency)
    if counted:
        counts = np.rint(raw).astype(np.int64).tolist()
        return [
            Reading(s, channel.name, count, s + TRANSPORT)
            for s, count in zip(stamps, counts, strict=True)
        ]
    step = (channel.high - channel.low) / ADC_STEPS
    volts = np.clip(
        channel.low + step * np.rint((raw - channel.low) / step), channel.low, channel.high
    ).tolist()
    return [
        Reading(s, channel.name, value, s + TRANSPORT)
        for s, value in zip(stamps, volts, strict=True)
    ]


def _wrench(
    wrench: Wrench, time: Array, response: Response, rng: np.random.Generator
) -> Iterable[Reading]:
    sensed = response.sensed
    axes = dict.fromkeys(WRENCH_FIELDS, np.zeros(time.size))
    axes["fx"] = _raw(wrench.drawbar_pull, np.asarray(sensed.drawbar_pull))
    axes["fz"] = _raw(wrench.load, np.asarray(sensed.load))
    axes["ty"] = _raw(wrench.torque, np.asarray(sensed.torque))
    noise = np.repeat([wrench.force_noise, wrench.torque_noise], 3)
    noisy = (
        axes[name] + sigma * rng.standard_normal(time.size)
        for name, sigma in zip(WRENCH_FIELDS, noise, strict=True)
    )
    six = np.stack(list(noisy), axis=1).tolist()
    stamps = _stamps(time, wrench.latency)
    return [
        Reading(s, "wrench", tuple(row), s + TRANSPORT) for s, row in zip(stamps, six, strict=True)
    ]


def _raw(calibration: Calibration, physical: Array) -> Array:
    raw: Array = (physical - calibration.offset.value) / calibration.scale.value
    return raw


def _stamps(time: Array, latency: float) -> list[int]:
    stamps: list[int] = (START + np.rint((time + latency) * NS).astype(np.int64)).tolist()
    return stamps


# ---- files ---------------------------------------------------------------------------------------
# ------------------


def write(path: Path, configuration: config.Configuration, info: RunInfo, run: Run) -> None:
    """The recording, raw topics only. Raises RecordingError."""
    writer = RunWriter(path, (), configuration.text, info)
    try:
        for reading in run.readings:
            writer.reading(reading)
    finally:
        writer.close()


def write_truth(
    path: Path, settings: Settings, soil: Soil, acting: Sequence[Effect], run: Run, seed: int
) -> None:
    """PATH.truth.json with soil, effects and seed; PATH.truth.npz with the true arrays."""
    said = {
        "wheel": asdict(settings.wheel),
        "soil": asdict(soil),
        "effects": {effect.name: asdict(effect) for effect in acting},
        "seed": seed,
        "overloaded_samples": int(run.response.overloaded.sum()),
    }
    path.with_suffix(".truth.json").write_text(json.dumps(said, indent=2) + "\n", encoding="utf-8")
    sensed = {f"sensed_{name}": value for name, value in vars(run.response.sensed).items()}
    arrays = {**sensed, **vars(run.motion), **vars(run.response)}
    kept = {name: value for name, value in arrays.items() if name != "sensed" and value is not None}
    np.savez_compressed(path.with_suffix(".truth.npz"), **kept)


# ---- command -------------------------------------------------------------------------------------
# ------------------


def main(argv: Sequence[str]) -> int:
    """Simulate, write the recording and its truth. Raises ConfigError or CommandError."""
    arguments = _parser().parse_args(argv)
    configuration = config.load(arguments.config)
    settings, soil = (
        configuration.settings,
        soil_of(configuration.settings, _soil_changes(arguments.soil)),
    )
    acting = _acting(settings, arguments.effect)
    vacant(arguments.output)
    motion, info = _motion(arguments, configuration)
    run = simulate_run(settings, soil, motion, acting, arguments.seed)
    try:
        write(arguments.output, configuration, info, run)
    except RecordingError as error:
        raise unwritten(error) from None
    write_truth(arguments.output, settings, soil, acting, run, arguments.seed)
    print(_summary(arguments.output, acting, run))
    return DONE


def _motion(
    arguments: argparse.Namespace, configuration: config.Configuration
) -> tuple[Motion, RunInfo]:
    """The motion of a recording if one is given, else that of the schedule; and what the run is
    called.
    """
    settings, driven = (
        configuration.settings,
        recorded(arguments.motion) if arguments.motion else None,
    )
    info = driven.run if driven else configuration.run
    info = replace(
        info, pass_number=arguments.pass_number or info.pass_number, name=arguments.output.stem
    )
    if driven:
        return replace(_driven(driven, settings), pass_number=float(info.pass_number)), info
    schedule = schedules.read(arguments.schedule)
    _check_length(arguments.schedule, schedule.duration, settings.rates.tick)
    place = float(info.pass_number), info.start_position
    info = replace(info, nominal_load=_weights(schedule.segments, info.nominal_load))
    return schedules.motion_of(schedule, settings.wheel.radius, settings.rates.tick, *place), info


def _weights(segments: Sequence[schedules.Segment], otherwise: float | None) -> float | None:
    """The weights of a whole run [N], where they are the same throughout."""
    loads = {segment.load for segment in segments}
    return loads.pop() if len(loads) == 1 and loads != {0.0} else otherwise


def _driven(recording: Recording, settings: Settings) -> Motion:
    """The motion of a recording. Raises CommandError."""
    stamps = recording.arrays("/raw/wheel_encoder")["stamp"]
    _check_length(
        recording.path,
        (int(stamps.max()) - int(stamps.min())) / NS if stamps.size else 0.0,
        settings.rates.tick,
    )
    try:
        return measured_run(recording, settings, settings.rates.tick).motion
    except RecordingError as error:
        raise CommandError(error, DAMAGED) from None


def _check_length(what: Path, seconds: float, rate: float) -> None:
    """Raises CommandError where a run would not fit into memory."""
    if seconds * rate > MOST_SAMPLES:
        found = f"{seconds:.0f} s, {seconds * rate:.0f} samples at {rate:g} Hz"
        longest = f"{MOST_SAMPLES}, which are {MOST_SAMPLES / rate:.0f} s"
        raise CommandError(f"{what}: found {found}; expected at most {longest}", USAGE)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd simulate",
        description="Simulate a run with Eqs. (1)-(10) and the effects; write its recording.",
    )
    parser.add_argument(
        "--config", default=packaged(), help="the testbed; default: the packaged testbed.yaml"
    )
    parser.add_argument(
        "--schedule",
        type=Path,
        default=packaged("schedule.yaml"),
        help="what to do; default: three loads, five slips",
    )
    parser.add_argument(
        "--motion",
        type=Path,
        metavar="FILE.mcap",
        help="drive as this recording was driven, in place of a schedule",
    )
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME.PARAMETER=VALUE",
        help="added to the configured ones",
    )
    parser.add_argument(
        "--soil",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"one of {', '.join(SOIL_VALUES)}",
    )
    parser.add_argument(
        "--pass",
        dest="pass_number",
        type=whole(1, 1000),
        metavar="N",
        help="which pass over the soil",
    )
    parser.add_argument("--seed", type=whole(0), default=0, help="of the noise; default 0")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT.mcap", help="must not exist yet"
    )
    return parser


def _acting(settings: Settings, given: Sequence[str]) -> tuple[Effect, ...]:
    """Configured effects that act on the testbed, with the values of the command line in their
    place.
    """
    values = {
        e.name: {name: value.value for name, value in e.parameters.items()}
        for e in settings.effects
    }
    for text in given:
        key, _, value = text.partition("=")
        name, _, parameter = key.partition(".")
        known = quantities(name)
        if known is None or parameter not in known:
            options = ", ".join(effects.EFFECTS if known is None else known)
            raise CommandError(
                f"--effect {text}: found '{name if known is None else parameter}'; expected one of {options}",
                USAGE,
            )
        values.setdefault(name, {})[parameter] = _quantity(
            f"--effect {text}", value, known[parameter].unit or ""
        )
    try:
        made = [effects.make(name, parameters) for name, parameters in values.items()]
    except ValueError as error:
        raise CommandError(error, USAGE) from None
    return tuple(effect for effect in made if not effect.filter_only)


def _soil_changes(given: Sequence[str]) -> dict[str, float]:
    changes = {}
    for text in given:
        name, _, value = text.partition("=")
        if name not in SOIL_VALUES:
            raise CommandError(
                f"--soil {text}: found '{name}'; expected one of {', '.join(SOIL_VALUES)}", USAGE
            )
        kind = SOIL_VALUES[name]
        changes[name] = _quantity(f"--soil {text}", value, kind.unit or "")
        if not kind.holds(changes[name]):
            raise CommandError(f"--soil {text}: found {value}; expected {kind.expected}", USAGE)
    return changes


def _quantity(where: str, text: str, unit: str) -> float:
    """A quantity with its unit, or a plain number in SI."""
    try:
        plain = units.NUMBER.fullmatch(text) is not None
        return float(text) if plain else units.parse(text, unit)
    except units.UnitError as error:
        raise CommandError(
            f"{where}: found '{text}' ({error}); expected a number in {unit or 'plain form'}", USAGE
        ) from None


def _summary(path: Path, acting: Sequence[Effect], run: Run) -> str:
    time = np.asarray(run.motion.time)
    bogged = int(run.response.overloaded.sum())
    lines = [
        f"{path}: {time[-1] - time[0]:.1f} s, {len(run.readings)} readings",
        f"effects: {', '.join(effect.name for effect in acting) or 'none'}",
        f"truth: {path.with_suffix('.truth.json')}, {path.with_suffix('.truth.npz')}",
    ]
    if bogged:
        lines.append(
            f"note: the load exceeds what the soil carries in {bogged} samples; the wheel is bogged there"
        )
    return "\n".join(lines)
