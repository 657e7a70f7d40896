"""A recorded run taken through the filter once more: its settings, its ticks, its pipeline."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.offline.playback import RecordedTick, recorded_ticks, without_absent
from gritd.estimator.offline.rerun import Rerun
from gritd.estimator.recording.salvage import Recording
from gritd.tools.cli.progress import Progress


def rerun_of(recordings: list[Recording], configuration: Configuration, as_it_ran: bool) -> Rerun:
    """as_it_ran: the recording's own ticks again; a force/torque sensor that never spoke was
    silent, not absent.
    """
    first = recordings[0]
    recorded = first if not as_it_ran or not first.counts["/tick"] else None
    announced_settings(first, configuration, recorded)
    return Rerun(configuration, lambda given: run_settings(first, given, recorded))


def announced_settings(
    first: Recording, configuration: Configuration, recorded: Recording | None
) -> Settings:
    """The settings of a run; says so where they do without a configured sensor."""
    settings = run_settings(first, configuration, recorded)
    if settings.wrench is None and configuration.settings.wrench is not None:
        print(f"{first.path}: no /raw/wrench: replayed with the configured load", file=sys.stderr)
    return settings


def run_settings(first: Recording, given: Configuration, recorded: Recording | None) -> Settings:
    """Settings of the run, without the sensors that `recorded` does not hold."""
    return settings_of_run(
        without_absent(given.settings, recorded) if recorded else given.settings, first.run
    )


def ticks_of(
    recordings: list[Recording], configuration: Configuration, what: str
) -> Iterator[tuple[Recording, RecordedTick]]:
    """Every tick of a run, its parts one after the other."""
    total = sum(recording.counts["/tick"] for recording in recordings)
    with Progress(f"{what} {recordings[0].path.name}", total) as progress:
        for recording in recordings:
            for tick in recorded_ticks(recording, configuration.settings.rates.tick):
                progress.advance()
                yield recording, tick
