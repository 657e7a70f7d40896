"""`gritd simulate`: the forward model alone, from a schedule to a recording, with the truth in
files beside it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from math import tan
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator import effects
from gritd.estimator.config import configuration as config
from gritd.estimator.config import units
from gritd.estimator.config.effects import quantities
from gritd.estimator.config.kinds import NumberWithUnit
from gritd.estimator.config.nearest import did_you_mean
from gritd.estimator.config.settings import Settings
from gritd.estimator.effects.base import Effect
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.recorded_motion import recorded_motion
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.stages.situation import Motion
from gritd.tools.cli.command import DAMAGED, DONE, USAGE, CommandError, Parser, whole
from gritd.tools.cli.files import recording as recorded
from gritd.tools.cli.files import unwritten, vacant
from gritd.tools.cli.progress import Progress
from gritd.tools.testbed import schedule as schedules
from gritd.tools.testbed.run_files import write, write_truth
from gritd.tools.testbed.simulation import SimulatedRun, simulate_run, soil_of

SOIL_VALUES = {  # with the bounds that they have in a configuration
    "cohesion": NumberWithUnit("Pa", low=0.0, high=1e6),
    "tan_phi": NumberWithUnit("", above=0.0, high=5.0),
    "phi": NumberWithUnit("rad", above=0.0, high=1.373),
    "shear_modulus": NumberWithUnit("m", above=0.0, high=1.0),
    "exponent": NumberWithUnit("", above=0.0, high=5.0),
    "modulus_factor": NumberWithUnit("", above=0.0, high=100.0),
}
SIMULATED = 0.45  # share of the time that is over when the run is written, 81 s and 40 min alike
MOST_SAMPLES = 1_800_000  # 2 h at 250 Hz: the run is made in memory, 1.9 kB a sample


def main(argv: Sequence[str]) -> int:
    """Simulate, write the recording and its truth. Raises ConfigError or CommandError."""
    arguments = build_parser().parse_args(argv)
    configuration = config.load(arguments.config)

    settings, soil = (
        configuration.settings,
        soil_of(configuration.settings, _soil_changes(arguments.soil)),
    )
    acting = acting_effects(settings, arguments.effect)

    vacant(arguments.output)
    motion, info = _motion(arguments, configuration)

    with Progress("simulate") as progress:
        progress.at("forward model")
        run = simulate_run(settings, soil, motion, acting, arguments.seed)
        progress.at("writing", SIMULATED)
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
        info,
        pass_number=arguments.pass_number or info.pass_number,
        name=arguments.output.stem,
        operator=arguments.operator or info.operator,
        notes=arguments.notes or info.notes,
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
        return recorded_motion(recording, settings, settings.rates.tick)
    except RecordingError as error:
        raise CommandError(error, DAMAGED) from None


def _check_length(what: Path, seconds: float, rate: float) -> None:
    """Raises CommandError where a run would not fit into memory."""
    if seconds * rate > MOST_SAMPLES:
        length = f"{seconds:.0f} s, {seconds * rate:.0f} samples at {rate:g} Hz"
        longest = f"{MOST_SAMPLES}, which are {MOST_SAMPLES / rate:.0f} s"
        raise CommandError(f"{what}: found {length}; expected at most {longest}", USAGE)


def build_parser() -> argparse.ArgumentParser:
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
    parser.add_argument("--operator", help="kept with the run; else the configuration's")
    parser.add_argument("--notes", help="kept with the run; else the configuration's")
    parser.add_argument("--seed", type=whole(0), default=0, help="of the noise; default 0")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT.mcap", help="must not exist yet"
    )

    return parser


def acting_effects(settings: Settings, given: Sequence[str]) -> tuple[Effect, ...]:
    """Configured effects that act on the testbed, with the values of the command line in their
    place.
    """
    values = {
        e.name: {name: value.value for name, value in e.parameters.items()}
        for e in settings.effects
    }

    for text in given:
        name, parameter, value = _effect(text)
        values.setdefault(name, {})[parameter] = value

    try:
        made = [effects.make(name, parameters) for name, parameters in values.items()]
    except ValueError as error:
        raise CommandError(error, USAGE) from None
    return tuple(effect for effect in made if not effect.filter_only)


def _effect(text: str) -> tuple[str, str, float]:
    """Effect, parameter and value in SI of NAME.PARAMETER=VALUE. Raises CommandError."""
    key, _, value = text.partition("=")
    name, _, parameter = key.partition(".")
    known = quantities(name)

    if known is None or (parameter and parameter not in known):
        word, options = (name, effects.EFFECTS) if known is None else (parameter, known)
        raise CommandError(
            f"--effect {text}: found '{word}'{did_you_mean(word, options)}; "
            f"expected one of {', '.join(options)}",
            USAGE,
        )

    if not parameter or not value:
        missing = "value" if parameter else "parameter"
        raise CommandError(f"--effect {text}: found no {missing}; {_parameters(name)}", USAGE)
    return name, parameter, _quantity(f"--effect {text}", value, known[parameter].unit or "")


def _parameters(name: str) -> str:
    """What can be stated of an effect, and one of it at the size to be expected."""
    parameters = effects.EFFECTS[name].parameters()
    stated = (f"{p.name} [{p.unit}]" if p.unit else p.name for p in parameters)
    first = parameters[0]
    example = f"{name}.{first.name}={min(first.centre + first.sigma, first.high):g}"
    return f"expected {name}.PARAMETER=VALUE, PARAMETER one of {', '.join(stated)}, as in {example}"


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
            degrees = f", such as {value} deg" if kind.unit == "rad" else ""
            expected = f"{kind.expected}{degrees}"
            raise CommandError(f"--soil {text}: found {value}; expected {expected}", USAGE)

    if "phi" in changes:
        changes["tan_phi"] = tan(changes.pop("phi"))
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


def _summary(path: Path, acting: Sequence[Effect], run: SimulatedRun) -> str:
    time = np.asarray(run.motion.time)
    bogged = int(run.response.overloaded.sum())

    lines = [
        f"{path}: {time[-1] - time[0]:.1f} s, {len(run.readings)} readings",
        f"effects: {', '.join(effect.name for effect in acting) or 'none'}",
        f"truth: {path.with_suffix('.truth.json')}, {path.with_suffix('.truth.npz')}",
    ]

    if bogged:
        lines.append(
            f"note: the load exceeds what the soil carries in {bogged} samples; "
            "the wheel is bogged there"
        )
    return "\n".join(lines)
