"""`gritd check-config`: is the configuration right, and how well can the testbed measure?"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from gritd.config import packaged
from gritd.drivers.build import build_decoder, build_link, keys_of, used_devices
from gritd.drivers.can_signals import amiss_elsewhere
from gritd.drivers.errors import DeviceSettingsError
from gritd.estimator.compiled import arithmetic
from gritd.estimator.config import configuration as config
from gritd.estimator.config.channels import UNITS
from gritd.estimator.config.json_schema import json_schema
from gritd.estimator.config.settings import (
    Calibration,
    Channel,
    Device,
    Rates,
    Settings,
    Uncertain,
    Wrench,
)
from gritd.estimator.messages.readings import ENCODERS
from gritd.estimator.offline.streams import RAW
from gritd.estimator.plausibility.recorded import driven_recording
from gritd.estimator.plausibility.words import louder, table, warnings
from gritd.estimator.plugins import left_out
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.wheel import geometry
from gritd.tools.cli import files
from gritd.tools.cli.command import DAMAGED, DONE, FAILED, USAGE, CommandError, Parser
from gritd.tools.cli.files import open_to_all
from gritd.tools.cli.progress import Progress
from gritd.tools.commands.rig_reach import reach

RIM_SPEED = 0.02  # [m/s] at which slip resolution is stated
SLIP = 0.2
QUANTUM = 1 / math.sqrt(12)  # standard deviation of a rounding error [count]

Rows = list[tuple[str, ...]]


def main(argv: Sequence[str]) -> int:
    """Print the summary, or the effective YAML. Raises ConfigError or CommandError for a file that
    cannot work.
    """
    arguments = build_parser().parse_args(argv)

    if arguments.schema:
        print(json.dumps(json_schema(), indent=1, ensure_ascii=False))
        return DONE

    read = config.load(arguments.file)

    try:
        check_devices(read.settings)
    except DeviceSettingsError as error:
        raise CommandError(f"{arguments.file}: {error}", USAGE) from None

    for line in (*open_to_all(Path(arguments.file), read.settings), *notes(read.settings)):
        print(line, file=sys.stderr)

    if arguments.effective:
        sys.stdout.write(read.text)
        return DONE

    ending = "" if read.ended else "; without a last line '...' it cannot be reloaded"
    sys.stdout.write(f"{arguments.file}: valid{ending}\n\n{summary(read.settings)}")
    code = against(read.settings, arguments.against) if arguments.against else DONE
    return USAGE if left_out else code


def against(settings: Settings, paths: Sequence[Path]) -> int:
    """Print what was driven in recordings by these settings, and what of it cannot be: then the
    code is 1. Raises CommandError.
    """
    runs = []
    with Progress("reading", len(paths)) as progress:
        for path in paths:
            progress.at(path.name)
            try:
                runs.append(driven_recording(files.recording(path, RAW), settings))
            except RecordingError as error:
                raise CommandError(error, DAMAGED) from None
            progress.advance()

    contradictions = list(warnings(runs))
    sys.stdout.write("\n" + "\n".join([*table(runs), *contradictions, *louder(runs)]) + "\n")
    return FAILED if contradictions else DONE


def check_devices(settings: Settings) -> None:
    """Raise DeviceSettingsError unless every used device can be built and every channel finds its
    signals in it.
    """
    for device in used_devices(settings):
        build_link(device, build_decoder(settings, device).framing, time.monotonic_ns)


def notes(settings: Settings) -> Iterator[str]:
    """What makes this installation slow, and what is wrong in a CAN database with messages that
    nobody listens to.
    """
    if not arithmetic.BUILT:
        yield f"note: arithmetic {arithmetic.IN_PYTHON}"
    for device in used_devices(settings):
        if wrong := amiss_elsewhere(device, keys_of(settings, device)):
            yield f"note: {wrong}"


# --- the summary ---


def summary(settings: Settings) -> str:
    """The effective configuration for a reader, and what it implies."""
    parts = [
        _table(_facts(settings)),
        _table(_channels(settings)),
        _implied_title(settings),
        _table(implied(settings)),
    ]
    return "\n".join(part + "\n" for part in parts)


def _facts(settings: Settings) -> Rows:
    wheel, soil, rates = settings.wheel, settings.soil, settings.rates
    modulus = soil.pressure_sinkage.modulus(wheel.width)
    effects = ", ".join(effect.name for effect in settings.effects) or "none"

    return [
        ("testbed", settings.testbed),
        (
            "wheel",
            f"r {1e3 * wheel.radius:g} mm, b {1e3 * wheel.width:g} mm, "
            f"θₘ = ({wheel.c1:g} + {wheel.c2:g} i) θ₁",
        ),
        ("pulley", f"r {1e3 * settings.pulley_radius:g} mm"),
        (
            "soil",
            f"c {_pm(soil.cohesion)} Pa, tan φ {_pm(soil.tan_phi)} (φ "
            f"{_degrees(soil.tan_phi.value):.1f}°)",
        ),
        ("", f"k {_pm(soil.shear_modulus, 1e3)} mm, n {_pm(soil.exponent)}"),
        (
            "",
            f"K {modulus / 1e3:.4g} kPa/mⁿ ± {100 * soil.modulus_sigma:g} % "
            f"({soil.pressure_sinkage.form})",
        ),
        (
            "load",
            f"{_pm(settings.load.nominal)} N; under {settings.load.minimum:g} N the wheel is in "
            "the air",
        ),
        (
            "drive",
            f"{_pm(settings.drive.torque_constant)} N·m/A at the axle; "
            f"torque from {settings.drive.torque_source}",
        ),
        (
            "rates",
            f"{rates.tick:g} ticks/s, {_updates(rates)}, horizon {1e3 * rates.horizon:g} ms",
        ),
        ("filter", f"{settings.filter.engine}, gate {settings.filter.gate:g} σ"),
        ("determines", reach(settings)),
        ("effects", effects),
        (
            "logging",
            f"{settings.logging.directory}, flushed every "
            f"{1e3 * settings.logging.flush_interval:g} ms",
        ),
        *((f"device {device.name}", _device(device)) for device in settings.devices.values()),
    ]


def _updates(rates: Rates) -> str:
    if rates.auto:
        return "windows of 0.1 to 3.2 s, as the noise of slip asks for"
    return f"{rates.update:g} updates/s"


def _device(device: Device) -> str:
    if device.kind == "serial":
        return f"serial {device.port}, {device.baud} baud, {device.framing}"
    signals = device.dbc or f"{len(device.signals)} signals defined inline"
    return f"can {device.interface} {device.channel}, {device.bitrate} bit/s, {signals}"


def _channels(settings: Settings) -> Rows:
    rows: Rows = [("channel", "device", "signal", "scale", "offset", "noise", "latency")]

    for name, channel in settings.channels.items():
        raw, physical, step = UNITS[name]
        scale, offset = _calibration(channel.calibration, f"{physical}/{raw}", physical)
        rows.append(
            (
                name,
                channel.device,
                channel.signal,
                scale,
                offset,
                f"{channel.noise:g} {step}",
                _ms(channel),
            )
        )

    return rows + (_wrench(settings.wrench) if settings.wrench else [])


def _wrench(wrench: Wrench) -> Rows:
    """One row for each component that is used."""
    components = [
        ("drawbar_pull", wrench.drawbar_pull, wrench.force_noise, "N"),
        ("side_force", wrench.side_force, wrench.force_noise, "N"),
        ("load", wrench.load, wrench.force_noise, "N"),
        ("torque", wrench.torque, wrench.torque_noise, "N·m"),
    ]

    return [
        (
            f"wrench {name}",
            wrench.device,
            wrench.signal,
            *_calibration(given, "", unit),
            f"{noise:g} {unit}",
            _ms(wrench),
        )
        for name, given, noise, unit in components
        if given is not None
    ]


def _calibration(given: Calibration, slope: str, unit: str) -> tuple[str, str]:
    """Scale and offset with their units."""
    slope = "" if slope == "K/degC" else slope
    return f"{_pm(given.scale)} {slope}".rstrip(), f"{_pm(given.offset)} {unit}"


def _ms(channel: Channel | Wrench) -> str:
    return f"{1e3 * channel.latency:g} ms"


def _implied_title(settings: Settings) -> str:
    ticks = window_readings(settings)
    return (
        "Resolution (one standard deviation, noise alone) of one reading and of a window of "
        f"{ticks} readings,\n"
        f"one reading a tick; slip at a rim speed of {1e3 * RIM_SPEED:g} mm/s and {100 * SLIP:g} "
        "% slip:"
    )


def implied(settings: Settings) -> Rows:
    """Quantity, resolution of one reading, resolution of a window."""
    mean = math.sqrt(window_readings(settings))
    current = settings.channels["motor_shunt"]
    torque = (
        current.noise * abs(current.calibration.scale.value) * settings.drive.torque_constant.value
    )

    if settings.drive.torque_source == "wrench" and settings.wrench:
        torque = settings.wrench.torque_noise

    pot = settings.channels["sinkage_pot"]
    sinkage = pot.noise * abs(pot.calibration.scale.value)

    rim, travel = speed_sigmas(settings)
    slip = slip_sigma(settings)

    return [
        ("torque", f"{torque:.2g} N·m", f"{torque / mean:.2g} N·m"),
        ("sinkage", f"{1e3 * sinkage:.2g} mm", f"{1e3 * sinkage / mean:.2g} mm"),
        ("rim speed", "", f"{1e3 * rim:.2g} mm/s"),
        ("travel speed", "", f"{1e3 * travel:.2g} mm/s"),
        ("slip", "", f"{100 * slip:.2g} %"),
    ]


def window_readings(settings: Settings) -> int:
    """Readings of a channel in one window, at one a tick."""
    return round(settings.rates.tick / settings.rates.update)


def speed_sigmas(settings: Settings) -> tuple[float, float]:
    """Standard deviations [m/s] of rim and travel speed, as slopes of the counts in one window."""
    radii = (settings.wheel.radius, settings.pulley_radius)
    rim, travel = (
        _slope_sigma(settings, settings.channels[name]) * r
        for name, r in zip(ENCODERS, radii, strict=True)
    )
    return rim, travel


def slip_sigma(settings: Settings) -> float:
    """Standard deviation of slip at RIM_SPEED and SLIP, from one window."""
    return geometry.slip_sigma(
        geometry.slip(RIM_SPEED, RIM_SPEED * (1 - SLIP)), *speed_sigmas(settings)
    )


def _slope_sigma(settings: Settings, encoder: Channel) -> float:
    """[rad/s]: a line through N readings a tick apart has variance 12 σ² / (N (N² − 1) dt²)."""
    count = window_readings(settings)
    sigma = max(encoder.noise, QUANTUM) * abs(encoder.calibration.scale.value)
    return sigma * settings.rates.tick * math.sqrt(12 / (count * (count**2 - 1)))


def _pm(quantity: Uncertain, factor: float = 1.0) -> str:
    """`value ± sigma`, or the value alone where it is exact."""
    sigma = f" ± {quantity.sigma * factor:g}" if quantity.sigma else ""
    return f"{quantity.value * factor:.7g}{sigma}"


def _degrees(tangent: float) -> float:
    return math.degrees(math.atan(tangent))


def _table(rows: Rows) -> str:
    """Columns of equal width."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = (
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )
    return "\n".join(lines)


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd check-config", description="Check a configuration and show what it implies."
    )
    parser.add_argument(
        "file", nargs="?", default=packaged(), help="default: the packaged testbed.yaml"
    )
    parser.add_argument(
        "--effective", action="store_true", help="print the YAML with every default filled in"
    )
    parser.add_argument(
        "--schema",
        action="store_true",
        help="print the JSON Schema of the configuration, for editors, and read no file",
    )
    parser.add_argument(
        "--against",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="a recording to hold it against, as often as wanted: exit 1 where it cannot be",
    )

    return parser
