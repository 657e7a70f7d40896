"""Imported runs as what is checked for what cannot be."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.plausibility.driven import DrivenRun, Raw, driven
from gritd.estimator.plausibility.mistakes import QuantitySource
from gritd.tools.importers.recording import ChannelReadings
from gritd.tools.importers.series.mapping import CLOCK, SeriesMap
from gritd.tools.importers.series.runs import SeriesRun

QUANTITIES = {
    "time": ("time",),
    "wheel": ("wheel_angle", "wheel_speed", "rim_speed", "wheel_count"),
    "carriage": ("carriage_position", "carriage_speed", "carriage_count"),
    "sinkage": ("sinkage", "sinkage_volts"),
    "load": ("load",),
    "torque": ("torque", "motor_torque", "current", "shunt_volts"),
    "pull": ("drawbar_pull",),
}


def driven_of(
    runs: Sequence[SeriesRun], streams: Sequence[Sequence[ChannelReadings]], settings: Settings
) -> list[tuple[DrivenRun, Settings]]:
    """Every run as it was driven, with the settings that hold for it."""
    made = []
    for run, own in zip(runs, streams, strict=True):
        raw = {stream.channel: Raw(stream.stamps, stream.values) for stream in own}
        of_run = settings_of_run(settings, run.info)
        made.append((driven(run.info.name, raw, of_run, run.info.nominal_load), of_run))
    return made


def sources_of(mapped: SeriesMap) -> dict[str, QuantitySource]:
    """Which column each quantity comes from."""
    sources = {}
    for quantity, channels in QUANTITIES.items():
        for channel in channels:
            name = mapped.named(channel)
            if name is not None and quantity not in sources:
                column = mapped.columns[name]
                unit = column.unit if channel != "time" or column.unit != CLOCK else ""
                scale = column.per_unit if unit else 1.0
                sources[quantity] = QuantitySource(name, channel, unit, scale)
    return sources
