"""`gritd calibrate WHAT`: known values against what a sensor reads, and the configuration with
scale and offset ± σ.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path

from gritd.estimator.config import configuration as config
from gritd.estimator.config import units
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.config.yamltree import read_text
from gritd.tools.calibrate import plot
from gritd.tools.calibrate.capture import capture
from gritd.tools.calibrate.live import Live
from gritd.tools.calibrate.outcome import CalibrationOutcome, written
from gritd.tools.calibrate.procedures import datum, encoders, load, pot, press, shunt, soil, torque
from gritd.tools.calibrate.sources import (
    CalibrationSource,
    RecordedSteps,
    known_value,
    known_values,
    steps,
)
from gritd.tools.calibrate.straight import Straight
from gritd.tools.cli import configuration_file
from gritd.tools.cli.command import DONE, USAGE, CommandError, Parser, number, whole
from gritd.tools.cli.files import recording
from gritd.tools.cli.yaml_edit import EditedYaml
from gritd.tools.importers import plates

TO_DO = {  # while the sensors are recorded
    "datum": "lift the wheel and lower it until it touches the surface, three times or more",
    "torque": "let the wheel turn in the air at two steady speeds or more, both ways"
    " (with --sensor: drive at several loads or slips)",
}
SET_VALUES = "set one value after the other, each for two seconds or more"
READ = 3.0  # [s] at each value, unless --seconds says otherwise
Procedure = Callable[[argparse.Namespace, Settings], CalibrationOutcome]


def main(argv: Sequence[str]) -> int:
    """Calibrate, print, write where asked. Raises CommandError, ConfigError."""
    arguments = build_parser().parse_args(argv)
    source = Path(arguments.config)
    place = None
    if arguments.apply is not None or arguments.in_place:
        place = configuration_file.target(source, arguments.apply, arguments.in_place, "--apply")
    configuration = config.load(source)
    settings = configuration.settings
    if arguments.record is not None:
        _capture(arguments, configuration)
    before = EditedYaml(read_text(source), str(source))

    outcome = PROCEDURES[arguments.what](arguments, settings)
    print(outcome.text(before))
    if arguments.png is not None:
        plot.draw(arguments.png, outcome)
    if place is None:
        print("nothing is written; --in-place writes it, --apply NEW.yaml to another file")
        return DONE

    text = _text(outcome, configuration_file.edited(source), arguments)
    backup = configuration_file.save(text, source, place)
    print(f"written: {place}" + (f"; as it was: {backup}" if backup else ""))
    if not arguments.serial and (kept := outcome.serial(before)):
        print(f"{kept}: kept beside the new date; --serial N states another sensor's")
    return DONE


def _capture(arguments: argparse.Namespace, configuration: Configuration) -> None:
    """Record what the procedure asks for; from there on it is as if the file had been given. Raises
    CommandError.
    """
    if arguments.what == "soil":
        total = len(arguments.record)
        for number, path in enumerate(arguments.record, start=1):
            what = f"press {number} of {total}: press the plate into the soil"
            capture(configuration, path, arguments.seconds, what)
        arguments.files += arguments.record
        return

    if arguments.recorded is not None:
        raise CommandError("--record: expected it without --from", USAGE)
    arguments.recorded = capture(
        configuration, arguments.record, arguments.seconds, TO_DO.get(arguments.what, SET_VALUES)
    )


def _text(outcome: CalibrationOutcome, document: EditedYaml, arguments: argparse.Namespace) -> str:
    """The configuration with what was found. Bekker's moduli take the place of Reece's."""
    if any(value.path == ("soil", "k_c") for value in outcome.values):
        for key in ("k1", "k2"):
            document.remove("soil", key)
    return written(outcome, document, arguments.date, arguments.serial)


# --- procedures ---


def _straight(procedure: Straight) -> Procedure:
    def run(arguments: argparse.Namespace, settings: Settings) -> CalibrationOutcome:
        _check_wrench(procedure.signal.channel, settings)
        known, source = _known(arguments, settings, procedure.shown)
        return procedure.outcome(source, known)

    return run


def _encoders(arguments: argparse.Namespace, settings: Settings) -> CalibrationOutcome:
    """Turns of the wheel, or lengths of rail."""
    if (arguments.wheel is None) == (arguments.carriage is None):
        raise CommandError("encoders: expected --wheel TURNS or --carriage LENGTHS", USAGE)
    turns = arguments.wheel is not None
    arguments.known = arguments.wheel if turns else arguments.carriage
    known, source = _known(arguments, settings, "turn" if turns else "mm")
    if turns:
        return encoders.outcome(encoders.WHEEL, source, known)
    return encoders.outcome(encoders.CARRIAGE, source, known, settings.pulley_radius)


def _datum(arguments: argparse.Namespace, settings: Settings) -> CalibrationOutcome:
    """Touches given by the load in a recording, by the user live or as --step."""
    if arguments.recorded is None:
        live = _live(arguments, settings, "mm")
        return datum.outcome(live.touches(datum.POT, arguments.touches), settings)
    if arguments.step:
        known, source = _known(arguments, settings, "mm")
        return datum.outcome([p.raw.value for p in source.points(datum.POT, known)], settings)
    _check_wrench("wrench", settings)
    recorded = recording(arguments.recorded)
    return datum.outcome(datum.touches(recorded, settings, arguments.touch_force), settings)


def _torque(arguments: argparse.Namespace, settings: Settings) -> CalibrationOutcome:
    """A lever where torques are known; else a recording of spinning, or with a torque sensor."""
    if arguments.known is not None or arguments.step:
        known, source = _known(arguments, settings, "N*m")
        return torque.by_lever(source, known, settings)

    if arguments.recorded is None:
        raise CommandError(
            "torque: expected --known TORQUES, --from FILE.mcap or --record NEW.mcap", USAGE
        )

    recorded = recording(arguments.recorded)
    if arguments.sensor:
        _check_wrench("wrench", settings)
        return torque.by_sensor(recorded, settings)
    return torque.by_spinning(recorded, settings)


def _soil(arguments: argparse.Namespace, settings: Settings) -> CalibrationOutcome:
    tests = [_press(path, arguments, settings) for path in arguments.files]
    if not tests:
        raise CommandError("soil: expected FILES of plate tests, or --record", USAGE)
    return soil.outcome(tests, settings)


def _press(path: Path, arguments: argparse.Namespace, settings: Settings) -> soil.Press:
    """A table by a map, a text file, or a recording of this testbed pressing a plate."""
    diameter = None if arguments.plate is None else known_value(arguments.plate, "m")
    if diameter is not None and diameter <= 0.0:
        raise CommandError(f"--plate {arguments.plate}: expected a diameter above 0", USAGE)

    if path.suffix.lower() == ".mcap":
        _check_wrench("wrench", settings)
        if diameter is None:
            raise CommandError(f"{path}: expected --plate, its diameter, with it", USAGE)
        return press.read(recording(path), settings, diameter / 2.0, arguments.touch_force)
    if arguments.map is None:
        return soil.read(path)
    log = plates.plate_log(path, plates.load(arguments.map), diameter)
    return soil.of_press(path.name, log.radius, log.force, log.depth, arguments.touch_force)


PROCEDURES: dict[str, Procedure] = {
    "pot": _straight(pot.POT),
    "shunt": _straight(shunt.SHUNT),
    "load": _straight(load.LOAD),
    "torque": _torque,
    "encoders": _encoders,
    "datum": _datum,
    "soil": _soil,
}


def _check_wrench(channel: str, settings: Settings) -> None:
    if channel == "wrench" and settings.wrench is None:
        raise CommandError(
            "channels.wrench: found nothing; expected a force/torque sensor in the configuration",
            USAGE,
        )


def _known(
    arguments: argparse.Namespace, settings: Settings, shown: str
) -> tuple[list[Uncertain], CalibrationSource]:
    """The known values, and where their readings come from. Raises CommandError."""
    unit = _si(shown)
    sigma = known_value(arguments.known_sigma, unit) if arguments.known_sigma else 0.0
    if arguments.step and arguments.recorded is None:
        raise CommandError("--step: expected --from FILE.mcap with it", USAGE)
    if arguments.step:
        times, known = steps(arguments.step, unit, sigma)
        return known, RecordedSteps(arguments.recorded, tuple(times))
    if arguments.known is None:
        raise CommandError(
            f"{arguments.what}: expected --known VALUES, such as '0, 10, 20 {shown}'", USAGE
        )

    known = known_values(arguments.known, unit, sigma)
    if arguments.recorded is not None:
        return known, RecordedSteps(arguments.recorded)
    return known, _live(arguments, settings, shown)


def _si(shown: str) -> str:
    return {"mm": "m", "turn": "rad"}.get(shown, shown)


def _live(arguments: argparse.Namespace, settings: Settings, shown: str) -> Live:
    factor = float(units.unit(shown).factor)
    return Live(settings, arguments.seconds or READ, _ask, shown, factor)


def _ask(what: str) -> None:
    """Wait for Enter. Raises CommandError where nobody can press it."""
    print(f"{what}, then press Enter", file=sys.stderr, flush=True)
    if not sys.stdin.readline():
        raise CommandError("standard input ended; expected Enter for each known value", USAGE)


# --- options ---


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd calibrate",
        description="Fit scale and offset to known values; see docs/calibrating.md.",
    )
    commands = parser.add_subparsers(dest="what", metavar="WHAT", required=True)

    summaries = {
        "pot": pot.SUMMARY,
        "shunt": shunt.SUMMARY,
        "load": load.SUMMARY,
        "torque": torque.SUMMARY,
        "encoders": encoders.SUMMARY,
        "datum": datum.SUMMARY,
        "soil": soil.SUMMARY,
    }

    for name, summary in summaries.items():
        command = commands.add_parser(name, help=summary, description=summary)
        _add_common(command)
        if name == "soil":
            _add_presses(command)
        else:
            _add_readings(command)
        _add_own(name, command)

    return parser


def _add_common(command: argparse.ArgumentParser) -> None:
    command.add_argument("--config", required=True, metavar="F", help="the testbed")
    command.add_argument("--apply", type=Path, metavar="NEW.yaml", help="write it there")
    command.add_argument(
        "--in-place", action="store_true", help="change F; as it was it stays beside, as F.bak"
    )
    command.add_argument("--serial", default="", help="serial number of the sensor")
    command.add_argument(
        "--date", type=_date, default=date.today().isoformat(), help="default: today"
    )
    command.add_argument(
        "--png", type=Path, metavar="OUT.png", help="draw line and residuals; or .svg"
    )


def _add_readings(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--from",
        dest="recorded",
        type=Path,
        metavar="FILE.mcap",
        help="read this recording; else the live sensors",
    )
    command.add_argument(
        "--known", metavar="VALUES", help="in the order in which they are set: '0, 10, 20 mm'"
    )
    command.add_argument(
        "--known-sigma", metavar="VALUE", help="standard deviation of a known value: '0.01 mm'"
    )
    command.add_argument(
        "--step",
        action="append",
        default=[],
        metavar="BEGIN-END=VALUE",
        help="with --from: seconds at which a value was set; else stretches at rest are found",
    )
    command.add_argument(
        "--record",
        type=Path,
        metavar="NEW.mcap",
        help="record the live sensors until Enter, then as --from NEW.mcap",
    )

    command.add_argument(
        "--seconds", type=number(above=0.0), help="to read each value, default 3; or to record"
    )


def _add_presses(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "files", nargs="*", type=Path, metavar="FILE", help="plate tests: tables, or .mcap"
    )
    command.add_argument(
        "--map", type=Path, metavar="MAP.yaml", help="which columns of FILE are force and depth"
    )
    command.add_argument("--plate", metavar="DIAMETER", help="of the plate: '60 mm'")
    command.add_argument(
        "--record",
        action="append",
        type=Path,
        metavar="NEW.mcap",
        help="record this testbed pressing the plate, until Enter; once for each press",
    )

    command.add_argument("--seconds", type=number(above=0.0), help="to record each press")
    _add_touch(command)


def _add_touch(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--touch-force",
        type=number(above=0.0),
        default=2.0,
        metavar="N",
        help="load that is a touch; default 2 N",
    )


def _add_own(name: str, command: argparse.ArgumentParser) -> None:
    """Options of one procedure alone."""
    if name == "encoders":
        command.add_argument("--wheel", metavar="TURNS", help="of the wheel: '0, 1, 2 turn'")
        command.add_argument("--carriage", metavar="LENGTHS", help="of rail: '0, 500, 1000 mm'")

    if name == "datum":
        command.add_argument(
            "--touches", type=whole(1, 100), default=3, help="live: so many; default 3"
        )
        _add_touch(command)

    if name == "torque":
        command.add_argument(
            "--sensor",
            action="store_true",
            help="with --from: torque constant from the wrench and the current",
        )


def _date(text: str) -> str:
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"found {text[:40]!r}; expected a date such as 2026-11-22"
        ) from None
