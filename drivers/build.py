"""From the configuration to readers that can be started."""

from __future__ import annotations

from collections.abc import Callable

from gritd.drivers.can_libraries import Signal, can
from gritd.drivers.can_link import CanLink, port_of
from gritd.drivers.can_signals import database
from gritd.drivers.decoder import Decoder
from gritd.drivers.errors import DeviceError, DeviceSettingsError
from gritd.drivers.framing import Framing
from gritd.drivers.framing_ascii import AsciiFraming
from gritd.drivers.framing_can import CanFraming
from gritd.drivers.framing_cobs import CobsFraming
from gritd.drivers.guarded import made
from gritd.drivers.link import Clock, Link
from gritd.drivers.port_lock import holder_of
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader, Tap
from gritd.drivers.recorded import Playback
from gritd.drivers.sensor import Sensor, SensorSettings, SignalShape, sensor_kinds
from gritd.drivers.serial_link import SerialLink
from gritd.estimator.config.settings import Device, Settings


def build_readers(
    settings: Settings,
    clock: Clock,
    queue: ReadingQueue,
    tap: Callable[[str], Tap | None] = lambda device: None,
    playback: Playback | None = None,
) -> list[Reader]:
    """One reader for each device that some channel uses, not yet started.

    clock: ns since the epoch, the daemon's own. tap: device name -> where to log its raw chunks,
    or None. playback: recorded wires in the place of the hardware. Raises DeviceSettingsError,
    one line, where channels, devices and signals do not fit together.
    """
    readers = []

    for device in used_devices(settings):
        decoder = build_decoder(settings, device)
        link: Link
        if playback is not None:
            link = playback.link(device.name)
        else:
            link = build_link(device, decoder.framing, clock)
        readers.append(Reader(device.name, link, decoder, queue, tap(device.name)))

    return readers


def check_free(settings: Settings) -> None:
    """Raise DeviceError where a device's port belongs to another process just now."""
    for device in used_devices(settings):
        port = port_of(device)
        if port and (holder := holder_of(port)):
            raise DeviceError(device.name, f"{port} is in use by {holder}")


def used_devices(settings: Settings) -> list[Device]:
    """The devices that some channel names, in the order of the configuration."""
    names = {of.device for of in _sensor_settings(settings).values()}
    for channel, of in _sensor_settings(settings).items():
        if of.device not in settings.devices:
            known = ", ".join(settings.devices) or "none"
            raise DeviceSettingsError(
                f"channel {channel}", f"no device {of.device!r}, there are: {known}"
            )
    return [device for name, device in settings.devices.items() if name in names]


def build_decoder(settings: Settings, device: Device) -> Decoder:
    """Framing and sensors of one device; serves live readers and recorded wires alike."""
    sensors = _sensors(settings, device)
    framing = _framing(device, _keys(sensors))
    if isinstance(framing, CanFraming):
        _check_signals(framing, sensors)
    else:
        _check_keys(sensors)
    return Decoder(framing, sensors)


def keys_of(settings: Settings, device: Device) -> list[str]:
    """The signals that channels take from a device."""
    return _keys(_sensors(settings, device))


def build_link(device: Device, framing: Framing, clock: Clock) -> Link:
    """The hardware end of a device."""
    if isinstance(framing, CanFraming):
        if device.interface not in can.VALID_INTERFACES:
            known = ", ".join(sorted(can.VALID_INTERFACES))
            reason = f"no CAN interface {device.interface!r}, expected one of {known}"
            raise DeviceSettingsError(f"device {device.name}", reason)
        return CanLink(device, framing.filters(), clock)
    return SerialLink(device.name, device.port, device.baud, clock)


def _sensor_settings(settings: Settings) -> dict[str, SensorSettings]:
    """Channel name -> settings, the wrench included."""
    wrench: dict[str, SensorSettings] = (
        {} if settings.wrench is None else {"wrench": settings.wrench}
    )
    return {**settings.channels, **wrench}


def _sensors(settings: Settings, device: Device) -> list[Sensor]:
    return [
        _sensor(name, of)
        for name, of in _sensor_settings(settings).items()
        if of.device == device.name
    ]


def _sensor(channel: str, settings: SensorSettings) -> Sensor:
    kinds = sensor_kinds()
    if channel not in kinds:
        raise DeviceSettingsError(
            f"channel {channel}", f"no such sensor, expected one of {', '.join(sorted(kinds))}"
        )
    return made(kinds[channel], settings)


def _keys(sensors: list[Sensor]) -> list[str]:
    return [key for sensor in sensors for key in sensor.keys]


def _framing(device: Device, keys: list[str]) -> Framing:
    if device.kind == "can":
        return CanFraming(device.name, database(device, keys), keys)
    return AsciiFraming() if device.framing == "ascii" else CobsFraming()


def _check_keys(sensors: list[Sensor]) -> None:
    """On a serial port a value comes in one frame: frames are numbered one by one, not by cycle."""
    for sensor in sensors:
        if len(sensor.keys) > 1:
            keys = "+".join(sensor.keys)
            reason = f"signal is {keys!r}, expected one key: a serial frame carries all values"
            raise DeviceSettingsError(sensor.channel, reason)


def _check_signals(framing: CanFraming, sensors: list[Sensor]) -> None:
    for sensor in sensors:
        if len(sensor.keys) > 1 and not all(map(framing.has_counter, sensor.keys)):
            reason = f"{' and '.join(sensor.keys)} make one value, expected a Cycle signal in each"
            raise DeviceSettingsError(sensor.channel, reason)
        signals = [signal for key in sensor.keys for signal in framing.signals(key)]
        sensor.check_signals(list(map(_shape, signals)))


def _shape(signal: Signal) -> SignalShape:
    is_float, scale, offset = signal.conversion.is_float, signal.scale, signal.offset
    counted = not is_float and scale == 1 and offset == 0  # integers, exactly as counted
    return SignalShape(
        signal.name, signal.length, counted, signal.is_signed, is_float, float(scale), float(offset)
    )
