"""What a recording says of the testbed it was made on, against the configuration it is used
with.

The wrong file after `--config` makes a mismatch that no physics explains. A recording holds the
configuration it was made with, so the difference can be said; it may be meant, when a calibration
was mended afterwards. The configuration of another testbed is refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.config.settings import Calibration, Settings
from gritd.estimator.recording.salvage import Recording
from gritd.tools.cli.command import USAGE, CommandError

WHEEL = "wheel."  # begins the keys of what no calibration mends
SAME_WHEEL = 0.1  # share of radius and width: more is another wheel, no correction
ROUNDED = 1e-6  # share by which a number may differ that was written and read


def check_rig(recordings: Sequence[Recording], settings: Settings, source: str) -> None:
    """Raises CommandError where a recording was made on another testbed than that of the
    configuration `source`: one of another name and other numbers, or of another wheel.
    """
    for recording in recordings:
        recorded = _recorded(recording)
        if recorded is not None and (difference := _other_rig(recorded, settings)):
            raise CommandError(
                f"{source}: another testbed than that of {recording.path.name}: {difference}; "
                "expected its own configuration, or --other-rig where it is meant",
                USAGE,
            )


def _other_rig(recorded: Settings, settings: Settings) -> str:
    """What tells two testbeds apart; '' where nothing does."""
    named = recorded.testbed != settings.testbed
    limit = ROUNDED if named else SAME_WHEEL
    differing = [text for text in _differences(recorded, settings, limit) if named or WHEEL in text]
    name = [f"testbed {recorded.testbed!r} (configuration: {settings.testbed!r})"] if named else []
    return ", ".join([*name, *differing]) if differing else ""


def remarks(recordings: Sequence[Recording], settings: Settings) -> list[str]:
    """A sentence for every set of differences that some of the recordings share."""
    shared: dict[tuple[str, ...], list[str]] = {}
    for recording in recordings:
        recorded = _recorded(recording) or settings
        if differing := tuple(_differences(recorded, settings, ROUNDED)):
            shared.setdefault(differing, []).append(recording.path.name)
    return [
        f"{_listed(names)} recorded with {', '.join(differing)}."
        for differing, names in shared.items()
    ]


def _recorded(recording: Recording) -> Settings | None:
    """The settings that a recording was made with; None where it does not tell them."""
    if recording.config_yaml is None:
        return None
    try:
        return config.loads(recording.config_yaml, str(recording.path)).settings
    except ConfigError:
        return None  # of another version: nothing to compare


def _differences(recorded: Settings, settings: Settings, limit: float) -> Iterator[str]:
    """What differs by more than `limit`, a share, in words."""
    values = dict(_values(recorded))
    for key, value in _values(settings):
        before = values.get(key, value)
        if not math.isclose(before, value, rel_tol=limit, abs_tol=limit * abs(before)):
            yield f"{key} {before:.6g} (configuration: {value:.6g})"


def _values(settings: Settings) -> Iterator[tuple[str, float]]:
    """What turns readings into physics, in SI, by key of the configuration."""
    yield "wheel.radius", settings.wheel.radius
    yield "wheel.width", settings.wheel.width
    yield "pulley_radius", settings.pulley_radius
    yield "drive.torque_constant", settings.drive.torque_constant.value
    for name, channel in settings.channels.items():
        yield from _calibration(f"channels.{name}", channel.calibration)
    if (wrench := settings.wrench) is not None:
        for axis in ("drawbar_pull", "side_force", "load", "torque"):
            if (known := getattr(wrench, axis)) is not None:
                yield from _calibration(f"channels.wrench.{axis}", known)


def _calibration(key: str, calibration: Calibration) -> Iterator[tuple[str, float]]:
    yield f"{key}.scale", calibration.scale.value
    yield f"{key}.offset", calibration.offset.value


def _listed(names: Sequence[str]) -> str:
    return (
        f"{names[0]} was"
        if len(names) == 1
        else f"{len(names)} runs ({names[0]} … {names[-1]}) were"
    )
