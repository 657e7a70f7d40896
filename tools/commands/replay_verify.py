"""`gritd replay --verify`: every tick of a recording computed again and compared with the logged
one, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.messages.tick import REVISION, TICK_NAMES, TickRow
from gritd.estimator.offline.playback import RecordedTick
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.metadata import TICK_REVISION, changed_versions
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.recording.topics import TICK_TOPIC
from gritd.tools.cli.command import DAMAGED, DONE, FAILED, USAGE, CommandError
from gritd.tools.commands.replay_run import rerun_of, ticks_of

SHOWN = 5  # differing fields named in full
# why a tick cannot be compared
NOT_BEGUN = "before the part's first state"
LOST = "after lost messages"
SEQUENCE, CONSUMED = TICK_NAMES.index("sequence"), TICK_NAMES.index("consumed")


def verify(recordings: list[Recording], configuration: Configuration) -> int:
    """Exit code: 0 where every tick is the same; 1 where one differs; 3 where messages are
    missing, so that not all can be compared. Raises CommandError.
    """
    first = recordings[0]
    _check(first)

    rerun = rerun_of(recordings, configuration, as_it_ran=True)
    differences, gaps = Differences(), Gaps()
    if first.run.part or first.run.bed:  # it did not begin with the stated prior
        rerun.lose()
        differences.why = NOT_BEGUN

    for recording, tick in ticks_of(recordings, configuration, "verifying"):
        if gaps.before(recording, tick):
            rerun.lose()
            differences.why = LOST
        try:
            if tick.checkpoint is not None:
                differences.resumed(tick.stamp, rerun.resume(tick.checkpoint))
            record = rerun.step(tick)
        except RecordingError as error:
            raise CommandError(f"{recording.path}: {error}", DAMAGED) from error

        if tick.logged is not None and rerun.known:
            differences.compare(tick.logged, record)
        elif tick.logged is not None:
            differences.skip()

    print(
        f"{first.path}: {differences.compared} ticks, {len(TICK_NAMES)} fields each: {differences}"
    )
    if differences.ticks and (changed := changed_versions(first.versions)):
        print(f"  computed by others: {'; '.join(changed)}")
    by = by_processor(configuration)
    if differences.ticks and by:
        print(f"  {by}: another processor alone may give other last digits")
    return _code(recordings, differences)


def by_processor(configuration: Configuration) -> str:
    """What of a configuration libraries compute whose sums are ordered by the processor; else the
    ticks are the same on every one.
    """
    settings = configuration.settings
    if settings.discrepancy is not None:
        return "the learnt discrepancy is computed by numpy's matrix product"
    return "filterpy computed the updates" if settings.filter.engine == "filterpy" else ""


def _check(first: Recording) -> None:
    """Raises CommandError where there is nothing to compare with."""
    path, by = first.path, f"gritd {first.versions.get('gritd', 'of another version')}"
    if not first.counts["/tick"]:
        raise CommandError(f"{path}: holds no /tick to verify against", USAGE)
    if first.topics["/tick"].names != TICK_TOPIC.names:
        raise CommandError(f"{path}: its /tick was written by {by} and has other fields", USAGE)

    revision = first.versions.get(TICK_REVISION, "1")
    if revision != str(REVISION):
        raise CommandError(
            f"{path}: its /tick was computed by revision {revision} of the filter ({by}), this "
            f"is revision {REVISION}: verify with that one, or recompute without --verify",
            USAGE,
        )


def _code(recordings: list[Recording], differences: Differences) -> int:
    """The exit code; says what is missing. Raises CommandError where nothing was compared."""
    missing = [(recording.path, lost) for recording in recordings if (lost := lost_of(recording))]
    for path, lost in missing:
        print(f"{path}: {lost} messages are missing")

    if not differences.compared and not missing:
        raise CommandError(
            f"{recordings[0].path}: its first state is not known; verify from the run's first part",
            USAGE,
        )
    return FAILED if differences.ticks else DAMAGED if missing else DONE


def lost_of(recording: Recording) -> int:
    """Messages known to be missing from a recording, what an earlier recovery noted included."""
    return recording.lost + int(recording.recovered.get("lost", "0"))


class Gaps:
    """Where a recording lacks messages: in it, if some are known to be missing, and before a part.

    A tick says how many readings it consumed and which number it has. Where the file holds another
    number of readings before it, or a number is left out, something is missing.
    """

    def __init__(self) -> None:
        self._recording: Recording | None = None
        self._sequence = -1  # of the last tick

    def before(self, recording: Recording, tick: RecordedTick) -> bool:
        """Whether messages are missing between the last tick and this one."""
        begins, self._recording = recording is not self._recording, recording
        gap = begins and recording.run.lost_before > 0

        if tick.logged is not None:
            left_out = tick.logged[SEQUENCE] != self._sequence + 1
            incomplete = tick.logged[CONSUMED] != len(tick.readings)
            gap |= lost_of(recording) > 0 and (left_out or incomplete)
            self._sequence = tick.logged[SEQUENCE]

        return gap


@dataclass
class Differences:
    """Fields of /tick that a replay did not reproduce."""

    ticks: int = 0
    compared: int = 0
    unknown: dict[str, int] = field(default_factory=dict)  # ticks not compared, by the reason
    why: str = ""  # of those that come now
    lines: list[str] = field(default_factory=list)

    def resumed(self, stamp: int, same: bool) -> None:
        """A checkpoint was met from the ticks before it."""
        if not same:
            self.ticks += 1
            self.lines.append(
                f"checkpoint before the tick at {stamp}: "
                "not the state that the ticks before it lead to"
            )

    def skip(self) -> None:
        """A tick whose state is not known."""
        self.unknown[self.why] = self.unknown.get(self.why, 0) + 1

    def compare(self, logged: TickRow, computed: TickRow) -> None:
        """Count a tick; name what differs in it."""
        self.compared += 1
        encode = TICK_TOPIC.codec.encode
        if encode(logged) == encode(computed):
            return
        self.ticks += 1
        for name, was, now in zip(TICK_NAMES, logged, computed, strict=True):
            if repr(was) != repr(now) and float(was) != float(now) and len(self.lines) < SHOWN:
                self.lines.append(f"tick {self.compared}: {name}: logged {was!r}, replayed {now!r}")

    def __str__(self) -> str:
        if not self.ticks:
            more = [f"; {n} more {why} not comparable" for why, n in self.unknown.items()]
            return f"identical bit for bit{''.join(more)}"
        return "\n  ".join([f"{self.ticks} ticks differ", *self.lines])
