"""Whether the filter is fed: which channels are silent or stand still, and since when."""

from __future__ import annotations

from collections.abc import Mapping

from gritd.estimator.daemon.notice import Notice
from gritd.estimator.messages.status import Status
from gritd.estimator.messages.tick import TICK_NAMES

NS = 1e-9
HUNGRY = 1.0  # [s] without what the filter needs before it is said to be unfed
PLACE = {name: at for at, name in enumerate(TICK_NAMES)}
UNFED = (Status.STARTING, Status.STALE, Status.STUCK)
STALE, STUCK = "nothing usable arrives", "stuck while others move"


class Feed:
    """Follows the ticks, in order, as often as it is asked to."""

    def __init__(self) -> None:
        self.unfed = ""  # why the filter has not been fed for a second; empty while it is
        self._hungry_since: float | None = None
        self._troubled: dict[str, tuple[str, float]] = {}  # channel -> what is wrong, since when

    def look(self, tick: tuple[float, ...], used: Mapping[str, int]) -> tuple[Notice, ...]:
        """What begins or ends. used: CHANNEL_BITS of the channels that there are."""
        now, status = float(tick[PLACE["stamp"]]) * NS, Status(int(tick[PLACE["status"]]))
        wrong = _wrong(tick, used)
        self._feel(status, wrong, now)
        # before the first full window a channel may take its time
        if status == Status.STARTING and not self.unfed:
            return ()
        return (*self._begun(wrong, now), *self._ended(wrong, now))

    def _feel(self, status: Status, wrong: Mapping[str, str], now: float) -> None:
        if status not in UNFED:
            self._hungry_since, self.unfed = None, ""
            return
        if self._hungry_since is None:
            self._hungry_since = now
        if now - self._hungry_since >= HUNGRY:
            self.unfed = f"{status.name} {', '.join(wrong)}".rstrip()

    def _begun(self, wrong: Mapping[str, str], now: float) -> tuple[Notice, ...]:
        notices = []
        for what in (STALE, STUCK):
            known = {name for name, (word, _) in self._troubled.items() if word == what}
            names = [name for name, word in wrong.items() if word == what and name not in known]
            self._troubled.update({name: (what, now) for name in names})
            if names:
                notices.append(Notice(f"{_channels(names)}: {what}"))
        return tuple(notices)

    def _ended(self, wrong: Mapping[str, str], now: float) -> tuple[Notice, ...]:
        names = [name for name in self._troubled if name not in wrong]
        if not names:
            return ()
        lasted = max(now - self._troubled.pop(name)[1] for name in names)
        return (Notice(f"{_channels(names)}: well again, after {lasted:.1f} s", over=True),)


def _wrong(tick: tuple[float, ...], used: Mapping[str, int]) -> dict[str, str]:
    """What is wrong, by channel."""
    stale, stuck = int(tick[PLACE["stale"]]), int(tick[PLACE["stuck"]])
    faults = {name: STUCK for name, bit in used.items() if stuck & bit}
    return faults | {name: STALE for name, bit in used.items() if stale & bit}


def _channels(names: list[str]) -> str:
    return f"channel{'s' * (len(names) > 1)} {', '.join(names)}"
