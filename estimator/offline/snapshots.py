"""Snapshots of a whole recording at once: what `Sync` would say at chosen ticks, from
arrays.

`Sync` takes one reading after another, because on line there is no other way. A recording has
them all, and each of Sync's rules is a statement about a sorted array: late is what its tick
consumed after the window had closed, a repeated reading is the second of one stamp, a window is
a slice between two searches, a jump a difference of neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.config.settings import Calibration, Settings
from gritd.estimator.messages.readings import ENCODERS, NS, WRENCH_FIELDS
from gritd.estimator.messages.status import CHANNEL_BITS
from gritd.estimator.offline.streams import RecordedStreams, Stream
from gritd.estimator.offline.windows import Bools, Ints, Members, WindowLines, lines, members
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.wheel.sync import STUCK_AFTER, Measured, Snapshot, window_at_first
from gritd.estimator.wheel.windows import DITHER, ENOUGH, STEP, Sample


def encoder_samples(
    settings: Settings, recorded: RecordedStreams, tick: int, length: int
) -> dict[str, list[Sample]]:
    """What each encoder read in the window of `length` [ns] that ends at a tick of this number."""
    view = View(settings, recorded, np.array([tick]), length)
    return {name: view.samples(name) for name in ENCODERS}


ANALOGUE = ("sinkage_pot", "motor_shunt")
NEVER = -(1 << 62)  # [ns]
AT_ONCE = 500  # windows that are numbers of Python at a time


def snapshots(
    settings: Settings, recorded: RecordedStreams, chosen: Ints, length: int | None = None
) -> Iterator[Snapshot]:
    """What Sync says at the ticks numbered `chosen`, shape (m,), ascending; equal to rounding.

    length: of the windows [ns]; default: as a run begins.

    They are handed out one by one: as numbers of Python a window takes ten times its place in an
    array, and a heap of them is walked over and over by the garbage collector.
    """
    view = View(settings, recorded, chosen, length or window_at_first(settings))
    wheel = view.slope("wheel_encoder", 1.0)
    carriage = view.slope("carriage_encoder", settings.pulley_radius)
    means = {name: view.mean(name) for name in settings.channels if name not in ENCODERS}
    axes = view.wrench()
    torque = ["motor_shunt"] if settings.drive.torque_source == "motor_shunt" else []
    sought = [means[name].known for name in ("sinkage_pot", *torque)]
    required = [wheel.known, carriage.known, *sought]

    columns: tuple[NDArray[Any] | Series, ...] = (
        view.centres,
        np.logical_and.reduce(required),
        wheel.position,
        wheel,
        carriage.position,
        carriage,
        *(means[name] for name in ANALOGUE),
        *axes,
        means.get("motor_temperature", view.nothing).value,
        view.stale(),
        view.stuck(wheel, carriage, means, axes),
    )

    for begin in range(0, len(chosen), AT_ONCE):
        part = slice(begin, begin + AT_ONCE)
        rows = zip(*(_listed(column, part) for column in columns), strict=True)
        yield from map(Snapshot._make, rows)


@dataclass(frozen=True)
class Series:
    """A quantity in every window, SI: NaN ± 0 where it is not known."""

    value: Array  # (m,)
    sigma: Array  # (m,)
    known: Bools  # (m,)
    still: Ints  # (m,) for how long the raw value has not changed, but for a dither [ns]


@dataclass(frozen=True)
class EncoderSeries(Series):
    """The speed of an encoder, and its position."""

    position: Array  # (m,)

    @property
    def moves(self) -> Bools:
        """Whether a speed differs from zero by more than its noise explains (m,)."""
        return np.abs(self.value) > 4.0 * self.sigma


def _listed(column: NDArray[Any] | Series, part: slice) -> Iterable[Any]:
    """Some windows of a column as Python's numbers, of a series as measurements."""
    if isinstance(column, Series):
        return map(Measured, column.value[part].tolist(), column.sigma[part].tolist())
    listed: list[Any] = column[part].tolist()
    return listed


class AcceptedReadings(NamedTuple):
    """The readings of a channel that came in time, each stamp once, and the windows they lie in."""

    stamp: Ints  # (n,) [ns], ascending
    values: NDArray[Any]  # (n,)
    members: Members

    def still(self, ends: Ints) -> Ints:
        """How long the value had not changed (m,) [ns] at the ends of the windows (m,) [ns], 0 in
        an empty one.
        """
        changed = np.append(True, self.values[1:] != self.values[:-1])
        return self._since(changed, self.members.size > 0, ends)

    def nearly_still(self, ends: Ints, near: Callable[[Ints], Array]) -> Ints:
        """The same (n,) [ns] but for a dither between two values no further apart than `near` of
        the stamps; 0 in a window that holds a third. See wheel.windows.MeanWindow.
        """
        windows, two = self.members, self.members.hold_two(self.values)
        # a window of three values is not still, whatever came before: look as far as the others go
        end = int(windows.last[two].max()) + 1 if two.any() else 0
        lasts, changed = np.full(len(self.values), np.inf), np.full(len(self.values), True)
        lasts[:end], changed[:end] = _followed(self.values[:end], near(self.stamp[:end]))

        others = self.values[windows.reading] != lasts[windows.last][windows.window]
        same = (windows.size > 0) & (windows.sum(others.astype(float)) == 0.0)
        return self._since(changed, same | (two & (windows.size >= ENOUGH)), ends)

    def _since(self, changed: Bools, known: Bools, ends: Ints) -> Ints:
        since = np.maximum.accumulate(np.where(changed, self.stamp, 0))
        return np.where(known, ends - since[self.members.last], 0)


def _followed(values: Array, near: Array) -> tuple[list[float], list[bool]]:
    """The value (n,) that each reading (n,) is held to be, and whether it is another than before: a
    reading no further than near (n,) from the last one is that one.
    """
    lasts, changed, last = [], [], np.inf
    for value, distance in zip(values.tolist(), near.tolist(), strict=True):
        changed.append(abs(value - last) > distance)
        last = value if changed[-1] else last
        lasts.append(last)
    return lasts, changed


class View:
    """A recording seen through the windows that end at chosen ticks."""

    def __init__(
        self, settings: Settings, recorded: RecordedStreams, chosen: Ints, length: int
    ) -> None:
        self._settings = settings
        self._streams = recorded.streams
        self._chosen = chosen
        self._ticks = recorded.ticks[chosen]
        # ends of the windows of all ticks [ns]
        self._closed = recorded.ticks - round(settings.rates.horizon * NS)
        self.length = length
        self.ends = self._closed[chosen]
        self.centres = self.ends - length // 2
        nan, zero = np.full(len(chosen), np.nan), np.zeros(len(chosen))
        self.nothing = EncoderSeries(nan, zero, zero > 0, np.zeros(len(chosen), np.int64), nan)

    def mean(self, name: str) -> Series:
        """An analogue channel."""
        channel = self._settings.channels[name]
        stream = self._streams.get(name)
        if stream is None:
            return self.nothing
        valid = (channel.low <= stream.values) & (stream.values <= channel.high)
        return self._mean(
            stream, stream.values, valid, channel.latency, channel.noise, channel.calibration
        )

    def wrench(self) -> tuple[Series, Series, Series]:
        """Load, drawbar pull and torque about the axle."""
        wrench, stream = self._settings.wrench, self._streams.get("wrench")
        if wrench is None or stream is None:
            return self.nothing, self.nothing, self.nothing
        limits = np.repeat([wrench.max_force, wrench.max_torque], 3)
        absent = np.isnan(stream.values)  # an axis that is not measured
        valid = (
            np.all(absent | (np.abs(stream.values) <= limits), axis=1)
            & ~absent[:, WRENCH_FIELDS.index("fz")]
        )

        def axis(name: str, noise: float, calibration: Calibration) -> Series:
            values = stream.values[:, WRENCH_FIELDS.index(name)]
            return self._mean(
                stream, values, valid & ~np.isnan(values), wrench.latency, noise, calibration
            )

        return (
            axis("fz", wrench.force_noise, wrench.load),
            axis("fx", wrench.force_noise, wrench.drawbar_pull) if wrench.pulls else self.nothing,
            axis("ty", wrench.torque_noise, wrench.torque),
        )

    def _mean(
        self,
        stream: Stream,
        values: Array,
        valid: Bools,
        latency: float,
        noise: float,
        calibration: Calibration,
    ) -> Series:
        accepted = self._accepted(stream, values, valid, latency)
        if accepted is None:
            return self.nothing

        size = accepted.members.size
        mean = accepted.members.mean(accepted.values)
        heard = accepted.members.heard(STEP * accepted.members.step(accepted.values), noise)
        scale = calibration.scale.value
        return Series(
            np.where(size > 0, mean * scale + calibration.offset.value, np.nan),
            np.where(size > 0, heard / np.sqrt(np.maximum(size, 1)) * abs(scale), 0.0),
            size > 0,
            accepted.nearly_still(self.ends, lambda stamp: self._near(stamp, noise)),
        )

    def _near(self, stamp: Ints, noise: float) -> Array:
        """How far each of the first readings (n,) may be from another one of a sensor that stands
        still.
        """
        inside = np.arange(len(stamp)) - np.searchsorted(stamp, self._opened(stamp), "right")
        return np.where(inside >= ENOUGH, DITHER * noise, 0.0)

    def _opened(self, stamp: Ints) -> Ints:
        """The beginning of the window (n,) into which each reading comes [ns]."""
        return np.append(-1, self._closed - self.length)[np.searchsorted(self._closed, stamp)]

    def slope(self, name: str, arm: float) -> EncoderSeries:
        """Position and speed of an encoder; arm is the pulley radius, or 1 for an angle."""
        channel, stream = self._settings.channels[name], self._streams.get(name)
        if stream is None:
            return self.nothing
        every = np.full(stream.stamp.shape, True)
        accepted = self._accepted(stream, stream.values, every, channel.latency)
        if accepted is None:
            return self.nothing

        accepted = self._rebaselined(accepted, channel.max_rate)
        stamp, counts, members = accepted
        line = lines(members, stamp, counts, self.centres)
        span = stamp[members.last] - stamp[members.first]
        known = (members.size >= 3) & (span >= self.length // 2)

        scale = channel.calibration.scale.value * arm
        position = line.middle * scale + channel.calibration.offset.value * arm
        sigma = _slope_sigma(members.heard(line.left, channel.noise), members.size, line)
        return EncoderSeries(
            np.where(known, line.rate * scale, np.nan),
            np.where(known, sigma * abs(scale), 0.0),
            known,
            accepted.still(self.ends),
            np.where(known, position, np.nan),
        )

    def samples(self, name: str) -> list[Sample]:
        """What an encoder read in the last of the windows."""
        channel, stream = self._settings.channels[name], self._streams[name]
        every = np.full(stream.stamp.shape, True)
        accepted = self._accepted(stream, stream.values, every, channel.latency)
        if accepted is None:
            return []
        stamp, counts, members = self._rebaselined(accepted, channel.max_rate)
        inside = slice(members.first[-1], members.last[-1] + 1)
        pairs = zip(stamp[inside].tolist(), counts[inside].tolist(), strict=True)
        return [Sample(*pair) for pair in pairs]

    def _accepted(
        self, stream: Stream, values: NDArray[Any], valid: Bools, latency: float
    ) -> AcceptedReadings | None:
        """The readings in time, sorted, each stamp once; None without any."""
        stamp = stream.stamp - round(latency * NS)
        taken = np.flatnonzero(valid & (stamp > np.append(-1, self._closed)[stream.tick]))
        stamp = stamp[taken]
        if np.any(stamp[1:] < stamp[:-1]):
            order = np.argsort(stamp, kind="stable")
            taken, stamp = taken[order], stamp[order]

        fresh = np.diff(stamp, prepend=-1) > 0
        stamp, values = stamp[fresh], values[taken[fresh]]
        if not stamp.size:
            return None
        return AcceptedReadings(stamp, values, members(stamp, self.ends - self.length, self.ends))

    def _rebaselined(self, accepted: AcceptedReadings, max_rate: float) -> AcceptedReadings:
        """With every jump taken out, and windows cut at a second one; see
        wheel.windows.SlopeWindow.
        """
        stamp, counts, _ = accepted
        step, elapsed = np.diff(counts), np.diff(stamp)
        opened = self._opened(stamp)
        fast = np.abs(step) * float(NS) > max_rate * elapsed + 2.0 * NS

        # a reading that enters an empty window has nothing to jump from
        closing = np.searchsorted(self._closed, stamp)
        fresh = (closing[:-1] < closing[1:]) & (stamp[:-1] <= opened[1:])
        jumps = np.flatnonzero(fast & ~fresh) + 1

        shifted, shift, done = counts.copy(), 0, 0
        last, cut, cuts = 0, 0, np.zeros(len(stamp), np.int64)
        for i in jumps.tolist():
            shifted[done:i] += shift
            start = max(int(np.searchsorted(stamp, opened[i], "right")), cut)
            expected = _expected_step(
                stamp[start:i], shifted[start:i], int(elapsed[i - 1]), self.length // 2
            )
            shift, done = shift + expected - int(step[i - 1]), i
            cut = i if start < last else cut  # the last jump is still in the window
            cuts[i], last = cut, i
        shifted[done:] += shift

        after = np.append(-1, stamp)[np.maximum.accumulate(cuts)][accepted.members.last]
        windows = members(stamp, np.maximum(self.ends - self.length, after), self.ends)
        return AcceptedReadings(stamp, shifted, windows)

    def stale(self) -> Ints:
        """CHANNEL_BITS (m,) of channels last heard of longer ago than they may be, or never."""
        silence = {name: channel.stale_after for name, channel in self._settings.channels.items()}
        if self._settings.wrench is not None:
            silence["wrench"] = self._settings.wrench.stale_after
        bits = np.zeros(len(self._ticks), np.int64)
        for name, limit in silence.items():
            bits += CHANNEL_BITS[name] * (self._ticks - self._heard(name) > round(limit * NS))
        return bits

    def _heard(self, name: str) -> Ints:
        """When the last bytes of a channel had come, by the chosen ticks [ns]."""
        stream = self._streams.get(name)
        if stream is None:
            return np.full(self._ticks.shape, NEVER)
        latest = np.append(NEVER, np.maximum.accumulate(stream.received))
        return latest[np.searchsorted(stream.tick, self._chosen, "right")]

    def stuck(
        self,
        wheel: EncoderSeries,
        carriage: EncoderSeries,
        means: Mapping[str, Series],
        axes: Sequence[Series],
    ) -> Ints:
        """CHANNEL_BITS (m,) of channels that stand still while others move; see sync.Sync."""
        bits = CHANNEL_BITS["wheel_encoder"] * (carriage.moves & (wheel.still >= STUCK_AFTER))
        moving = wheel.moves | carriage.moves
        for name in ANALOGUE:
            if self._settings.channels[name].noise > 0.0:
                bits = bits + CHANNEL_BITS[name] * (moving & (means[name].still >= STUCK_AFTER))
        return np.asarray(bits + CHANNEL_BITS["wrench"] * (moving & self._frozen(axes)))

    def _frozen(self, axes: Sequence[Series]) -> Bools:
        """Whether no axis of the wrench that is measured shows one digit of noise."""
        wrench = self._settings.wrench
        if wrench is None:
            return np.zeros(len(self._ticks), bool)
        noises = (wrench.force_noise, wrench.force_noise, wrench.torque_noise)
        live = [
            axis.known & ((axis.still < STUCK_AFTER) | (noise <= 0.0))
            for axis, noise in zip(axes, noises, strict=True)
        ]
        return np.asarray(np.any([axis.known for axis in axes], axis=0) & ~np.any(live, axis=0))


def _slope_sigma(noise: Array, size: Ints, line: WindowLines) -> Array:
    """Standard deviation of each window's rate (m,) [raw/s]; see geometry.slope_sigma."""
    count = np.maximum(size, 1)
    independent = np.minimum(count, (line.moved + 1.0) ** 2)
    with np.errstate(divide="ignore", invalid="ignore"):  # a window of one reading has no slope
        sigma: Array = noise / line.spread * np.sqrt(count / independent)
    return sigma


def _expected_step(stamp: Ints, counts: Ints, elapsed: int, shortest: int) -> int:
    """Counts that the readings before a jump predict for the time elapsed [ns], in exact
    integers as Sync has them.
    """
    count = len(stamp)
    if count < 3 or stamp[-1] - stamp[0] < shortest:
        return 0

    t, x = (stamp - stamp[0]).tolist(), (counts - counts[0]).tolist()
    spread = count * integer_sum([a * a for a in t]) - integer_sum(t) ** 2
    products = integer_sum([a * b for a, b in zip(t, x, strict=True)])
    rate = (count * products - integer_sum(t) * integer_sum(x)) / spread * NS
    expected: int = round(rate * elapsed / NS)
    return expected
