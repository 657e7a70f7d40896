"""Recordings of one bed, one after the other: what each knows alone, and what all know together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from gritd.estimator.config.settings import Repeatability, Settings
from gritd.estimator.filter.bank import Bank, reported
from gritd.estimator.filter.reasons import Reason
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.status import Flag
from gritd.estimator.offline.batch import Replayed, replayed
from gritd.estimator.online.bed import Known, after_run, before_run, surprise
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.recording import Recording

Advance = Callable[[int, int], None]


class BedRun(NamedTuple):
    """One run of a bed."""

    recording: Recording
    settings: Settings
    prior: Bank
    alone: Replayed  # begun with the stated prior
    carried: Replayed  # begun with what the runs before it know
    known: Known  # of the bed after it
    surprise: float  # by which it moved what was known: chi-square, 3 degrees of freedom

    @property
    def another_soil(self) -> bool:
        """Whether the soil differs from that of the runs before it, and did not change within the
        run.
        """
        together, alone = (
            (run.rows["flags"] & Flag.CHANGED) > 0 for run in (self.carried, self.alone)
        )
        return bool(together.any() and not alone.any())

    @property
    def reason(self) -> Reason:
        """Why the bed's estimate does not rest on it."""
        if self.another_soil:
            return Reason(
                "does not fit the runs before it", "prepare the bed anew, or leave it out"
            )
        return self.carried.reason

    @property
    def counts(self) -> bool:
        """Whether the bed's estimate rests on it too."""
        return not self.reason.why


def doubted(runs: Sequence[BedRun]) -> Reason:
    """Why what the runs know together is not believed: more than a third of them are not."""
    refused = [run for run in runs if not run.counts]
    if len(refused) == len(runs):
        first = refused[0].reason
        return first if len(runs) == 1 else Reason("no run is believed", first.remedy)
    if 3 * len(refused) <= len(runs):
        return Reason()
    why = f"{len(refused)} of {len(runs)} runs are not believed"
    return Reason(why, refused[0].reason.remedy)


def bed_runs(
    runs: Iterable[tuple[Settings, Recording]],
    repeatability: Repeatability,
    engine: str = "plain",
    advance: Advance = lambda done, total: None,
) -> Iterator[BedRun]:
    """Each run, in the order given. A run that the filter does not believe adds nothing. Raises
    RecordingError, also where a run has no readings.
    """
    known: Known | None = None
    for settings, recording in runs:
        prior = Tracker(settings, engine).prior_bank
        known = known or Known(prior, 0)

        alone = replayed(settings, recording, engine, None, advance)
        if not len(alone.rows):
            raise RecordingError(f"{recording.path}: holds no readings")

        start = before_run(known, repeatability)
        carried = alone
        if known.runs:
            carried = replayed(settings, recording, engine, start, advance)

        run = BedRun(
            recording,
            settings,
            prior,
            alone,
            carried,
            after_run(known, carried.bank, repeatability, carried.memory),
            surprise(reported(start.bank), carried.estimate),
        )
        run = run if run.counts else run._replace(known=known)
        known = run.known
        yield run
