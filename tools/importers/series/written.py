"""The configuration that fits imported time series: the user's own, or the template, with the
calibration of what was imported.
"""

from __future__ import annotations

from pathlib import Path
from string import Template

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.channels import LEAST_NOISE, UNITS
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import NO_SIGNAL
from gritd.estimator.config.yamltree import read_text
from gritd.tools.cli.command import USAGE
from gritd.tools.cli.yaml_edit import EditedYaml, quantity
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.series.calibrated import CalibratedChannel
from gritd.tools.importers.series.convert import Imported
from gritd.tools.importers.series.mapping import SeriesMap

WIDE = "[-1.0e+12 {unit}, 1.0e+12 {unit}]"  # a file's numbers were read already
WINDOW = 5  # readings that a window of the filter holds at least
UPDATES = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)  # [Hz]
LONG = 5.0  # intervals of silence after which a channel is stale
WRENCH = "device: {device}\nsignal: wrench\nforce_noise: 1 N\ntorque_noise: 1 N*m\n"


def base(mapped: SeriesMap, given: Path | None) -> tuple[str, Configuration]:
    """Text and settings to begin with. Raises ConfigError, RigFileError."""
    text, name, folder = _text(mapped, given)
    document = EditedYaml(text, name)
    if mapped.torque_constant is not None:
        path, constant = ("drive", "torque_constant"), mapped.torque_constant
        before = document.written(*path)
        document.set(path, quantity(constant.value, constant.sigma, "N*m/A", before))
    return document.text(), config.loads(document.text(), name, folder)


def _text(mapped: SeriesMap, given: Path | None) -> tuple[str, str, Path | None]:
    """The file that is given, or the template with the map's wheel."""
    if given is not None:
        return read_text(given), str(given), given.resolve().parent
    radius, width = mapped.radius, mapped.width
    if mapped.drive_alone and radius is None and width is None:
        radius = width = 1.0  # of no consequence: no soil is touched
    if radius is None or width is None:
        raise RigFileError(
            "wheel: found nothing in the map; expected its radius and width, or --config F", USAGE
        )
    text = packaged("rig_csv.yaml").read_text(encoding="utf-8")
    filled = Template(text).substitute(radius=f"{radius:.9g}", width=f"{width:.9g}")
    return filled, "rig_csv.yaml", None


def slow(text: str, settings: config.Configuration, interval: float, speeds: bool) -> str:
    """The text with a filter that is no faster than readings every `interval` [s] allow.

    speeds: whether an encoder stands for a column of speeds. Its noise holds for windows of one
    length, so that length is stated. Elsewhere a window that is to be chosen is.
    """
    rates, fastest = settings.settings.rates, 1.0 / (WINDOW * interval)
    if rates.auto and not speeds:
        return text
    if fastest >= rates.update and not rates.auto:
        return text
    document = EditedYaml(text, settings.source)
    update = next((rate for rate in UPDATES if rate <= fastest), UPDATES[-1])
    document.set(("rates", "update"), f"{update:g} Hz")
    return document.text()


def written(text: str, source: str, imported: Imported) -> str:
    """The text with what the import knows of each channel."""
    intervals = imported.intervals
    document = EditedYaml(text, source)
    for channel, calibrated in imported.channels.items():
        _ensure(document, channel)
        _set_channel(document, channel, calibrated, intervals[channel])

    for channel, noise in imported.configured.items():
        path = ("channels", channel)
        document.set((*path, "noise"), _noise(noise, UNITS[channel][2]))
        document.set((*path, "stale_after"), _stale_after(intervals[channel]))

    if "carriage_encoder" not in intervals:  # a drive alone
        for channel in ("carriage_encoder", "sinkage_pot"):
            document.set(("channels", channel, "signal"), NO_SIGNAL)
    if imported.axes:
        _set_wrench(document, imported.axes, intervals["wrench"])
    _set_source(document, imported)
    return document.text()


def _ensure(document: EditedYaml, channel: str) -> None:
    """A channel that the configuration lacks, at the device of another."""
    if not document.has("channels", channel):
        device = document.written("channels", "wheel_encoder", "device")
        document.set(("channels", channel), f"device: {device}\nsignal: {channel}\n")


def _set_channel(
    document: EditedYaml, channel: str, calibrated: CalibratedChannel, interval: float
) -> None:
    raw, physical, step = UNITS[channel]
    path = ("channels", channel)
    slope = "" if raw == "degC" else f"{physical}/{raw}"
    _set_calibration(document, path, calibrated, slope, physical)

    document.set((*path, "noise"), _noise(calibrated.noise, step))
    document.set((*path, "stale_after"), _stale_after(interval))
    if raw == "count":
        document.remove(*path, "max_rate")
    else:
        document.set((*path, "range"), WIDE.format(unit=raw))


def _set_wrench(document: EditedYaml, axes: dict[str, CalibratedChannel], interval: float) -> None:
    path = ("channels", "wrench")
    if not document.has(*path):
        device = document.written("channels", "wheel_encoder", "device")
        document.set(path, WRENCH.format(device=device))

    for axis, unit in (("drawbar_pull", "N"), ("load", "N"), ("torque", "N*m")):
        _set_calibration(document, (*path, axis), axes[axis], "", unit)
    if axes["lateral_force"].noise > 0.0:
        _set_calibration(document, (*path, "side_force"), axes["lateral_force"], "", "N")

    force = max(axes[axis].noise for axis in ("drawbar_pull", "load", "lateral_force"))
    document.set((*path, "force_noise"), _noise(force or axes["torque"].noise, "N"))
    document.set((*path, "torque_noise"), _noise(axes["torque"].noise or force, "N*m"))
    document.set((*path, "stale_after"), _stale_after(interval))
    for key in ("max_force", "max_torque", "latency"):
        document.remove(*path, key)


def _set_calibration(
    document: EditedYaml,
    path: tuple[str, ...],
    calibrated: CalibratedChannel,
    slope: str,
    unit: str,
) -> None:
    """Scale and offset; the day and the number of another calibration go."""
    scale, offset = calibrated.scale, calibrated.offset
    document.set((*path, "scale"), _exact(scale.value, scale.sigma, slope))
    document.set((*path, "offset"), _exact(offset.value, offset.sigma, unit))
    for key in ("date", "serial", "latency"):
        document.remove(*path, key)


def _set_source(document: EditedYaml, imported: Imported) -> None:
    """The torque is the sensor's where there is one, since a motor's holds what the drive loses."""
    sensed = "torque" in imported.axes and imported.axes["torque"].noise > 0.0
    motor = "motor_shunt" in (*imported.channels, *imported.configured)
    pulls = "drawbar_pull" in imported.axes and imported.axes["drawbar_pull"].noise > 0.0
    if sensed or motor or pulls:
        source = "wrench" if sensed else "motor_shunt" if motor else "none"
        document.set(("drive", "torque_source"), source)


def _exact(value: float, sigma: float, unit: str) -> str:
    """With all digits: a count's scale is a definition."""
    if sigma > 0.0:
        return quantity(value, sigma, unit)
    number = f"{value!r}" if unit else f"{value:.17f}".rstrip("0")
    return f"{number if not number.endswith('.') else number + '0'} {unit}".rstrip()


def _noise(value: float, unit: str) -> str:
    return f"{max(value, 2.0 * LEAST_NOISE):.3g} {unit}"


def _stale_after(interval: float) -> str:
    return f"{min(max(LONG * interval, 0.04), 10.0):.3g} s"
