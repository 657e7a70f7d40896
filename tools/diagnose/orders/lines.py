"""Lines that stand out of the spectra of all runs: ripples of the wheel, and vibrations in time.

The strongest is taken first, then the next beside it. A ripple of the wheel has one order at all
speeds, a vibration has one frequency: of the two the likelier is meant. The chance of a line counts
every place and channel that was tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.spectrum import log_chance, places_of, spectrum, sums_at
from gritd.tools.diagnose.orders.stretches import Samples
from gritd.tools.diagnose.orders.wave import Amplitude, amplitude_of, wave_of
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN, SQUARE

AXES = ("angle", "time")


@dataclass(frozen=True)
class SpectralLine:
    """A line of one channel.

    axis:       "angle": `at` ripples a turn of the wheel; "time": `at` in Hz.
    sigma:      standard deviation of `at`.
    amplitudes: of each run, None where the run does not tell; phase by the wheel encoder's angle,
        or by the time since the run began.
    p:          of as much by noise alone, all that were tried counted.
    frequency:  [Hz] of the ripple, the slowest and the fastest stretch.
    cell:       what the longest run resolves, in the unit of `at`.
    support:    evidence [nats] of this place and its harmonics in all channels: lugs and teeth
        strike, so a count of them has harmonics; what is merely not round has none.
    harmonic:   of which louder line of the channel it is a harmonic, by its `at`; else 0.
    before:     its size in a reference campaign, found there or not, in the channel's unit.
    """

    channel: str
    axis: str
    at: float
    sigma: float
    amplitudes: tuple[Amplitude | None, ...]
    p: float
    frequency: tuple[float, float]
    cell: float
    support: float
    harmonic: float = 0.0
    before: float = 0.0

    @property
    def size(self) -> float:
        """Root mean square over the runs of the amplitude, in the channel's unit."""
        return _size([a for a in self.amplitudes if a is not None])

    @property
    def size_sigma(self) -> float:
        """Standard deviation of the size."""
        known = [a.sigma for a in self.amplitudes if a is not None]
        return float(np.sqrt(np.mean(np.square(known)) / len(known))) if known else np.nan


def size_in(runs: Sequence[Mapping[str, Samples]], line: SpectralLine) -> float:
    """Size of a line in other runs, found there or not, in the channel's unit; 0 where they hold
    too little of it to tell.
    """
    sizes = []
    for _, samples in _parts(runs, line.channel):
        if line.at * samples.span(line.axis) >= TUNING.orders.cycles:
            left = samples.values - wave_of(samples, line.axis, line.at, whole=True)
            level = float(np.mean(left**2))
            sizes.append(amplitude_of(samples, line.axis, line.at, level))
    return _size(sizes)


def _size(amplitudes: Sequence[Amplitude]) -> float:
    """Root mean square of amplitudes without what noise adds; 0 of none."""
    squares = [a.size**2 - 2.0 * a.sigma**2 for a in amplitudes]
    return float(np.sqrt(max(float(np.mean(squares)), 0.0))) if squares else 0.0


class _Channel:
    """The spectra of one channel, less the lines found so far.

    parts: of runs, each with the number of its run, without trend.
    """

    def __init__(
        self, name: str, parts: Sequence[tuple[int, Samples]], axes: Sequence[str] = AXES
    ) -> None:
        self.name, self._run = name, [run for run, _ in parts]
        self.parts = [samples for _, samples in parts]
        self._waves: dict[tuple[str, float], list[Array]] = {}  # of each line taken, in each part
        self.places = {axis: places_of(self.parts, axis) for axis in axes}
        self._renew()
        self._first = dict(self.chances)

    def _renew(self) -> None:
        self.spectra = {
            axis: [spectrum(part, axis, places) for part in self.parts]
            for axis, places in self.places.items()
        }
        self._cleaned: dict[str, float] = {}  # of the strongest place of each axis
        self.chances = {axis: log_chance(spectra) for axis, spectra in self.spectra.items()}

    def strongest(self, axis: str, sure: float) -> tuple[float, int]:
        """Log chance of the strongest line, and its place: the loudest of those whose log chance is
        below `sure`, for a line of short stretches has quieter ones beside it, which may look as
        likely; without such the likeliest.
        """
        chances = self.chances[axis]
        place = int(np.argmin(chances))
        if chances[place] < sure:
            power = np.sum([s.power * s.known for s in self.spectra[axis]], axis=0)
            place = int(np.argmax(np.where(chances < sure, power, 0.0)))
        return float(chances[place]), place

    def support(self, axis: str, at: float) -> float:
        """Evidence [nats] of a line and its next harmonics in the readings as they were."""
        times = np.arange(1, TUNING.orders.harmonics + 1)
        near = [self._near(self._first[axis], axis, float(k * at)).min(initial=0.0) for k in times]
        return float(np.sum(np.maximum(-np.array(near) - TUNING.orders.supports, 0.0)))

    def cleaned(self, axis: str, place: int) -> float:
        """Log chance of the strongest line beside the noise that its neighbours have without it: a
        loud line spreads over them.
        """
        if axis in self._cleaned:
            return self._cleaned[axis]

        at, places = self.refined(axis, place), self.places[axis]
        beside = []
        for part, before in zip(self.parts, self.spectra[axis], strict=True):
            without = part.with_values(part.values - wave_of(part, axis, at, whole=True))
            after = spectrum(without, axis, places)
            beside.append(replace(after, power=before.power))

        self._cleaned[axis] = float(log_chance([s.at(slice(place, place + 1)) for s in beside])[0])
        return self._cleaned[axis]

    def near(self, axis: str, at: float) -> float:
        """Log chance of a line at this place or its neighbours in the grid, all of them counted."""
        near = self._near(self.chances[axis], axis, at)
        return float(near.min(initial=0.0) + np.log(max(near.size, 1)))

    def _near(self, chances: Array, axis: str, at: float) -> Array:
        place = round(at / self.places[axis].spacing)
        return chances[max(place - 1, 0) : place + 2]

    def refined(self, axis: str, place: int) -> float:
        """The likeliest place between its neighbours in the grid."""
        at, step = place * self.places[axis].spacing, self.places[axis].spacing
        for _ in range(TUNING.numerics.refinements):
            tried = at + step * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
            at = float(tried[int(np.argmax(self._gain(axis, place, tried)))])
            step *= 0.5
        return at

    def _gain(self, axis: str, place: int, tried: Array) -> Array:
        """-Log chance (t,) summed over the parts that tell."""
        gain = np.zeros(tried.size)
        for part, s in zip(self.parts, self.spectra[axis], strict=True):
            if np.isfinite(s.level[place]):
                power = np.abs(sums_at(part.of(axis), part.values, tried)) ** 2
                power /= part.values.size
                freedom = s.freedom[place]
                gain += 0.5 * freedom * np.log1p(2.0 * power / s.level[place] / freedom)
        return gain

    def amplitudes(
        self, before: Sequence[Samples], axis: str, at: float, runs: int
    ) -> tuple[Amplitude | None, ...]:
        """Of each run, its parts together, as they were before the line was taken."""
        place = min(round(at / self.places[axis].spacing), self.places[axis].count - 1)

        of_runs: list[list[Amplitude]] = [[] for _ in range(runs)]
        for run, part, s in zip(self._run, before, self.spectra[axis], strict=True):
            if np.isfinite(s.level[place]):
                of_runs[run].append(amplitude_of(part, axis, at, float(s.level[place])))
        return tuple(_together(each) for each in of_runs)

    def take(self, axis: str, at: float) -> None:
        """Leave a line out. Those taken before it are estimated anew beside it, each in turn: Li
        and Stoica (1996), IEEE Trans. Signal Process. 44, 281-295.
        """
        self._waves[axis, at] = [np.zeros(part.values.size) for part in self.parts]
        for _ in range(TUNING.numerics.sweeps if len(self._waves) > 1 else 1):
            for line in reversed(self._waves):
                self._retake(*line)
        self._renew()

    def _retake(self, axis: str, at: float) -> None:
        """Put a line back and leave it out as it now is."""
        waves = self._waves[axis, at]
        for number, part in enumerate(self.parts):
            whole = part.with_values(part.values + waves[number])
            waves[number] = wave_of(whole, axis, at)
            self.parts[number] = whole.with_values(whole.values - waves[number])

    def cell(self, axis: str) -> float:
        """What the longest part resolves."""
        return 1.0 / max(part.span(axis) for part in self.parts)

    def spread(self, axis: str, at: float, amplitudes: Sequence[Amplitude | None]) -> float:
        """Standard deviation of the line's place: Rife and Boorstyn (1974), IEEE Trans. Inf. Theory
        20, 591-598, var f = 3 var a/(π² A² T²) of each part.
        """
        precision = 0.0
        for run, part in zip(self._run, self.parts, strict=True):
            if (a := amplitudes[run]) is not None:
                precision += (np.pi * part.span(axis) * a.size / a.sigma) ** 2 / 3.0
        return float(1.0 / np.sqrt(max(precision, SQUARE)))

    def frequency(self, axis: str, at: float) -> tuple[float, float]:
        """[Hz] of a line in the slowest and in the fastest stretch."""
        if axis == "time":
            return at, at
        rates = [
            abs(float(s.angle[own][-1] - s.angle[own][0])) / max(float(np.ptp(s.time[own])), SPAN)
            for s in self.parts
            for own in s.slices
        ]
        return at * min(rates), at * max(rates)


def _together(parts: Sequence[Amplitude]) -> Amplitude | None:
    """Of parts with phases of their own: their size, by the phase of the first."""
    if len(parts) < 2:
        return parts[0] if parts else None
    size = float(np.sqrt(np.mean([a.size**2 for a in parts])))
    sigma = float(np.sqrt(np.mean([a.sigma**2 for a in parts]) / len(parts)))
    scale = size / max(parts[0].size, SQUARE)
    return Amplitude(scale * parts[0].cos, scale * parts[0].sin, sigma)


def find_lines(runs: Sequence[Mapping[str, Samples]]) -> tuple[SpectralLine, ...]:
    """Lines of all channels of these runs, by channel, the loudest first."""
    names = list(dict.fromkeys(name for run in runs for name in run))
    channels = [_Channel(name, parts) for name in names if (parts := list(_parts(runs, name)))]
    tried = sum(places.count for c in channels for places in c.places.values())

    lines: list[SpectralLine] = []
    for _ in range(TUNING.orders.most_lines):
        best = _likeliest(channels, tried)
        if best is None or best[0] + np.log(tried) > np.log(TUNING.orders.level):
            break
        chance, first, axis, place = best
        at = first.refined(axis, place)
        own = chance + np.log(tried)
        support = sum(channel.support(axis, at) for channel in channels)
        for channel in (first, *(c for c in channels if c is not first)):
            log_p = own if channel is first else channel.near(axis, at) + np.log(len(channels))
            if log_p <= np.log(TUNING.orders.level):
                line = _taken(channel, axis, at, float(np.exp(log_p)), support, len(runs))
                lines += [line, *_overtones(channel, line, len(runs))]
    return tuple(_with_harmonics(lines, channels))


def lines_along(parts: Sequence[Samples], searches: int) -> Iterator[float]:
    """Places of the lines of one channel along its time alone, each part with its own phase, the
    strongest first. searches: that are made like this one, all counted.
    """
    without_trend = [(0, p.with_values(p.detrended(p.values))) for p in parts]
    channel = _Channel("", without_trend, ("time",))
    sure = float(np.log(TUNING.orders.level / searches / channel.places["time"].count))
    for _ in range(TUNING.orders.most_lines):
        chance, place = channel.strongest("time", sure)
        if chance > sure:
            return
        at = channel.refined("time", place)
        channel.take("time", at)
        yield at


def _overtones(channel: _Channel, line: SpectralLine, runs: int) -> Iterator[SpectralLine]:
    """Harmonics of a line, which few places need be tried for."""
    times = range(2, TUNING.orders.harmonics + 1)
    for at in (k * line.at for k in times):
        log_p = channel.near(line.axis, at) + np.log(len(times))
        if log_p <= np.log(TUNING.orders.level):
            at = channel.refined(line.axis, round(at / channel.places[line.axis].spacing))
            yield _taken(channel, line.axis, at, float(np.exp(log_p)), 0.0, runs)


def _parts(runs: Sequence[Mapping[str, Samples]], name: str) -> Iterator[tuple[int, Samples]]:
    """The parts of a channel's runs, each with the number of its run, without trend."""
    for number, run in enumerate(runs):
        if name in run:
            for part in run[name].parts():
                yield number, part.with_values(part.detrended(part.values))


def _likeliest(channels: Sequence[_Channel], tried: int) -> tuple[float, _Channel, str, int] | None:
    """Log chance, channel, axis and place of the likeliest line of all."""
    if not channels:
        return None
    strongest = []
    sure = float(np.log(TUNING.orders.level / tried))
    for channel in channels:
        for axis in AXES:
            chance, place = channel.strongest(axis, sure)
            if chance < -np.log(tried):  # noise alone has less than one of these
                chance = min(chance, channel.cleaned(axis, place))
            strongest.append((chance, channel, axis, place))

    prefer = {"angle": TUNING.orders.prefer_angle, "time": 0.0}
    return min(strongest, key=lambda each: each[0] - prefer[each[2]])


def _taken(
    channel: _Channel, axis: str, at: float, p: float, support: float, runs: int
) -> SpectralLine:
    """The line, which the channel loses. The noise about it is what is left."""
    before = list(channel.parts)
    channel.take(axis, at)
    amplitudes = channel.amplitudes(before, axis, at, runs)

    return SpectralLine(
        channel.name,
        axis,
        at,
        channel.spread(axis, at, amplitudes),
        amplitudes,
        p,
        channel.frequency(axis, at),
        channel.cell(axis),
        support,
    )


def _with_harmonics(
    lines: Sequence[SpectralLine], channels: Sequence[_Channel]
) -> Iterator[SpectralLine]:
    """The lines by channel, the loudest first, each marked whether it is a harmonic."""
    for channel in channels:
        own = sorted((x for x in lines if x.channel == channel.name), key=lambda x: -x.size)
        for number, line in enumerate(own):
            louder = [x for x in own[:number] if x.axis == line.axis and not x.harmonic]
            yield replace(line, harmonic=_base(line, louder))


def _base(line: SpectralLine, louder: Sequence[SpectralLine]) -> float:
    for other in louder:
        times = round(line.at / other.at)
        near = abs(line.at - times * other.at) < line.cell
        if near and 2 <= times <= TUNING.orders.harmonics:
            return other.at
    return 0.0
