"""What a recording says of the testbed it was made on, against the configuration it is diagnosed
with.

The wrong file after `--config` makes a mismatch that no physics explains. A recording holds the
configuration it was made with, so the difference can be said; it may be meant, when a calibration
was mended afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.config.settings import Calibration, Settings
from gritd.estimator.recording.salvage import Recording
from gritd.tools.diagnose.tuning import TUNING


def remarks(recordings: Sequence[Recording], settings: Settings) -> list[str]:
    """A sentence for every set of differences that some of the recordings share."""
    shared: dict[tuple[str, ...], list[str]] = {}
    for recording in recordings:
        if differing := tuple(_differences(recording, settings)):
            shared.setdefault(differing, []).append(recording.path.name)
    return [
        f"{_listed(names)} recorded with {', '.join(differing)}."
        for differing, names in shared.items()
    ]


def _differences(recording: Recording, settings: Settings) -> Iterator[str]:
    if recording.config_yaml is None:
        return
    try:
        recorded = dict(_values(config.loads(recording.config_yaml, str(recording.path)).settings))
    except ConfigError:
        return  # of another version: nothing to compare
    for key, value in _values(settings):
        before = recorded.get(key, value)
        if not math.isclose(
            before,
            value,
            rel_tol=TUNING.explain.same_value,
            abs_tol=TUNING.explain.same_value * abs(before),
        ):
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
        for axis in ("drawbar_pull", "load", "torque"):
            yield from _calibration(f"channels.wrench.{axis}", getattr(wrench, axis))


def _calibration(key: str, calibration: Calibration) -> Iterator[tuple[str, float]]:
    yield f"{key}.scale", calibration.scale.value
    yield f"{key}.offset", calibration.offset.value


def _listed(names: Sequence[str]) -> str:
    return (
        f"{names[0]} was"
        if len(names) == 1
        else f"{len(names)} runs ({names[0]} … {names[-1]}) were"
    )
