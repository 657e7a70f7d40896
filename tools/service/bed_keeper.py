"""What the daemon does with the bed: a run begins with what the runs before it know, and adds to
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.daemon import bed_file
from gritd.estimator.daemon.bed_file import Bed, BedError
from gritd.estimator.daemon.clock import NS, wall_ns
from gritd.estimator.daemon.daemon import Daemon
from gritd.estimator.filter.reasons import withheld
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online.bed import RunStart, fingerprint


@dataclass(frozen=True)
class BedOfRun:
    """The bed that a run is driven on, as the run found it."""

    folder: Path
    bed: Bed
    settings: Settings  # of the run
    began: float  # [s since the epoch]
    trouble: str = ""  # why the bed that was there is not used: one line

    @property
    def start(self) -> RunStart | None:
        """What the run begins with; None for the stated prior."""
        return bed_file.start_of(self.bed, self.settings, self.began)

    def named(self, run: RunInfo) -> RunInfo:
        """The run, with the bed whose earlier runs it begins with."""
        return replace(run, bed=self.bed.name) if self.start is not None else run

    def announced(self) -> str:
        """What the run begins with, in a line."""
        if self.trouble:
            return f"{self.trouble}; the run begins with the stated prior"
        reason = bed_file.useless(self.bed, self.settings, self.began)
        if reason:
            return f"bed {self.bed.name!r}: begins with the stated prior: {reason}"
        return f"bed {self.bed.name!r}: begins with what {self.bed.runs} runs know"

    def closed(self, daemon: Daemon) -> str:
        """Keep what the run added; a line that says so, or why it adds nothing."""
        if reason := self._nothing_learnt(daemon):
            return f"bed {self.bed.name!r}: this run adds nothing: {reason}"

        assert daemon.loop.left is not None
        after = bed_file.after(
            self.bed, self.settings, daemon.loop.left.bank, self.began, wall_ns() / NS
        )

        try:
            bed_file.save(self.folder, after)
        except BedError as error:
            return f"bed {self.bed.name!r}: this run adds nothing: {error}"
        return f"bed {self.bed.name!r}: {after.runs} runs now"

    def _nothing_learnt(self, daemon: Daemon) -> str:
        if daemon.loop.left is None or daemon.loop.latest is None:
            return "it had no tick"

        settings = settings_of_run(daemon.configuration.settings, daemon.run)
        if fingerprint(settings) != fingerprint(self.settings):
            return "prior, calibration, filter or effects changed on the way"

        return str(withheld(daemon.loop.tracker, daemon.loop.left))


def bed_of_run(folder: Path, settings: Settings, run: RunInfo) -> BedOfRun | None:
    """The bed in the bin, or None. One that cannot be used is put aside."""
    now = wall_ns() / NS
    bed: Bed | None
    try:
        bed, trouble = bed_file.current(folder, settings, now), ""
    except BedError as error:
        bed, trouble = bed_file.anew(folder, settings, now), str(error)
    if bed is None:
        return None
    return BedOfRun(folder, bed, settings_of_run(settings, run), now, trouble)
