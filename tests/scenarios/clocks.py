"""Devices whose clocks are bad: random histories of one sensor's frames, and the truth.

What a history may have: a crystal off by up to 200 ppm, a clock that wraps or starts anew, steps of
either sign, single wrong stamps, the race of a 16-bit timer (a stamp read while it overflows is
65.536 ms off); delays that jitter, frames that a USB adapter holds back, and a host that stands
still. `judged` plays one through a decoder and says what became of every frame.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import inf
from typing import NamedTuple

from gritd.drivers.build import build_decoder
from gritd.drivers.can_link import packed
from gritd.drivers.decoder import Decoder
from gritd.drivers.link import Chunk
from gritd.drivers.wire import CanWire, SerialWire
from gritd.estimator.config.settings import Device, Settings

NS = 1_000_000_000
EPOCH = 1_700_000_000 * NS
KEYS = {"serial": "pot", "can": "SinkagePot.Volts"}
RACE = 65.536e-3  # [s] one turn of a 16-bit timer of microseconds
SHORTEST_BACK = 25e-3  # [s] and more than two sample periods: else the clock does not go back
NARROWEST = 1 << 24  # [µs] at which the clock of a CAN node wraps
PAUSE = 40e-3  # [s] without a frame: the host stood still
BELIEVED = 5  # frames that have to show a delay before it can be known
GRACE = 0.2  # [s] in which a step has to be recognised
CONVERGED = 1.0  # [s] after which the offset has to be right


class Sample(NamedTuple):
    """taken: [s] since the start; device_us: what the device says [µs]; wrong: how far that is from
    what its clock shows [s]; received: [s].
    """

    taken: float
    device_us: int
    wrong: float
    received: float


@dataclass
class History:
    """One device for a few seconds. `steps`: when its clock jumped, and by how much [s]."""

    device: Device
    samples: list[Sample]
    steps: list[tuple[float, float]]
    least: float  # the delay that every frame has [s]
    words: str  # what it is like


@dataclass
class Verdict:
    """What the decoder made of a history."""

    lost: int = 0  # good frames without a reading, but for those within GRACE of a step
    in_step: int = 0  # good frames lost within GRACE of a step, the most at one step
    error: float = 0.0  # largest error of a good frame's stamp, CONVERGED after start and steps [s]
    accepted: list[float] = field(default_factory=list)  # wrong stamps that were believed [s]


def with_pot(settings: Settings) -> Settings:
    """Settings whose sinkage potentiometer may say any number, so that it can number its frames."""
    pot = replace(settings.channels["sinkage_pot"], low=-inf, high=inf)
    return replace(settings, channels={"sinkage_pot": pot}, wrench=None)


def history(settings: Settings, rng: random.Random) -> History:
    """A random one, on a device of these settings."""
    device = rng.choices(list(settings.devices.values()), (0.85, 0.15))[0]
    seconds, rate = rng.uniform(3.0, 6.0), rng.choice((50.0, 100.0, 250.0, 500.0))
    taken = [(k + rng.uniform(0.0, 0.1)) / rate for k in range(int(seconds * rate))]
    steps = _steps(rng, seconds, max(SHORTEST_BACK, 2.2 / rate))
    wrong = _wrong(rng, taken)
    shown = list(_clock(rng, taken, steps, wrong))
    least = rng.uniform(0.1e-3, 3e-3)
    way = _batched if rate >= 250.0 and rng.random() < 0.6 else _jittery
    stall = _stall(rng, seconds)
    received = _in_order(_stalled(stall, [t + least for t in way(rng, taken)]))
    samples = [Sample(*all_of) for all_of in zip(taken, shown, wrong, received, strict=True)]
    words = f"{device.kind}, {rate:.0f} Hz, {way.__name__[1:]}, steps {steps}"
    return History(device, samples, steps, least, words)


def chunks(history: History) -> Iterator[Chunk]:
    """What the link of the device would hand over: frames that come together are one chunk."""
    serial = SerialWire(history.device) if history.device.kind == "serial" else None
    bus = None if serial else CanWire(history.device)
    waiting, due = b"", -1
    for number, sample in enumerate(history.samples):
        received = EPOCH + round(sample.received * NS)
        if serial is not None:
            data = serial.encode(KEYS["serial"], [float(number)], sample.device_us)
        else:
            assert bus is not None
            data = packed(bus.encode(KEYS["can"], [float(number)], sample.device_us))
        if waiting and (received != due or bus is not None):
            yield Chunk(due, waiting)
            waiting = b""
        waiting, due = waiting + data, received
    yield Chunk(due, waiting)


def judged(history: History, settings: Settings) -> Verdict:
    """Play it through the daemon's decoder, and look at every reading."""
    decoder = _decoder(history, settings)
    stamps = {
        int(reading.value): (reading.stamp - EPOCH) / NS  # type: ignore[arg-type]
        for chunk in chunks(history)
        for reading in decoder.decode(chunk.received, chunk.data)
    }
    verdict = Verdict()
    starts = [history.samples[0].received, *_first_after(history)]
    lost = dict.fromkeys(starts, 0)
    delays: dict[float, list[float]] = {start: [] for start in starts}  # the shortest ones
    awake = dict(zip((s.received for s in history.samples), _awake(history), strict=True))
    for number, sample in enumerate(history.samples):
        stamp, began = stamps.get(number), max(s for s in starts if s <= sample.received)
        age = awake[sample.received] - awake[began]
        if not sample.wrong:
            delays[began] = sorted([*delays[began], sample.received - sample.taken])[:BELIEVED]
        if sample.wrong:
            verdict.accepted += [] if stamp is None else [sample.wrong]
        elif stamp is None:
            verdict.lost += began == starts[0] or age > GRACE
            lost[began] += 1
        elif age > CONVERGED:
            late = stamp - sample.taken
            verdict.error = max(verdict.error, history.least - late, late - delays[began][-1])
    verdict.in_step = max(lost.values())
    return verdict


def _decoder(history: History, settings: Settings) -> Decoder:
    pot = replace(
        settings.channels["sinkage_pot"],
        device=history.device.name,
        signal=KEYS[history.device.kind],
    )
    return build_decoder(replace(settings, channels={"sinkage_pot": pot}), history.device)


def _awake(history: History) -> Iterator[float]:
    """For each frame, how long the host had received frames without a pause until then [s]."""
    awake, before = 0.0, history.samples[0].received
    for sample in history.samples:
        awake += min(sample.received - before, PAUSE)
        before = sample.received
        yield awake


def _first_after(history: History) -> Iterator[float]:
    """When the first frame after each step was received."""
    for at, _ in history.steps:
        yield next(s.received for s in history.samples if s.taken >= at and not s.wrong)


# --- the device's clock ---------------------------------------------------------------------------


def _steps(rng: random.Random, seconds: float, back: float) -> list[tuple[float, float]]:
    """None, one or two; the device restarts where the size is infinite. A step back of less than
    `back` [s] cannot be told from a longer way.
    """
    times = [rng.uniform(0.3, 1.2)] if rng.random() < 0.8 else []
    times += [times[0] + rng.uniform(1.3, 1.8)] if times and rng.random() < 0.4 else []
    return [(at, _step(rng, back)) for at in times if at < seconds]


def _step(rng: random.Random, back: float) -> float:
    kind = rng.random()
    if kind < 0.45:
        return -back * float((10.0 / back) ** rng.random())
    return inf if kind > 0.9 else float(10 ** rng.uniform(-3.0, 1.0))


def _wrong(rng: random.Random, taken: list[float]) -> list[float]:
    """How far each stamp is off [s]: single ones of any size, or the races of a 16-bit timer."""
    wrong = [0.0] * len(taken)
    kind = rng.choice(("none", "single", "race"))
    often = {"none": 0.0, "single": 0.004, "race": 0.0}[kind]
    for number, t in enumerate(taken):
        if rng.random() < often:
            wrong[number] = rng.choice((-1, 1)) * 10 ** rng.uniform(-1.6, 1.0)
        overflowed = number > 0 and t // RACE != taken[number - 1] // RACE
        if kind == "race" and overflowed and rng.random() < 0.2:
            wrong[number] = rng.choice((-1, 1)) * RACE
    return wrong


def _clock(
    rng: random.Random, taken: list[float], steps: list[tuple[float, float]], wrong: list[float]
) -> Iterator[int]:
    """What the device says at each moment [µs], not yet wrapped."""
    drift = rng.uniform(-200e-6, 200e-6)
    zero = (1 << 32) * rng.uniform(10.0, 11.0)  # [µs] far from nothing: a step back stays above it
    if rng.random() < 0.3:
        zero = (1 << 32) * 11 - rng.uniform(0.0, 5e6)  # wraps on the way
    due = list(steps)
    for t, off in zip(taken, wrong, strict=True):
        while due and due[0][0] <= t:
            _, size = due.pop(0)
            zero = _restarted(zero, t) if size == inf else zero + size * 1e6
        yield int(zero + t * (1.0 + drift) * 1e6 + off * 1e6)


def _restarted(zero: float, t: float) -> float:
    """The offset [µs] of a clock that began at zero a moment ago; it must not happen to go on."""
    anew = (1 << 32) * 20 - t * 1e6
    while not SHORTEST_BACK * 1e6 < (zero - anew) % NARROWEST < NARROWEST:
        anew += 1e5
    return anew


# --- the way --------------------------------------------------------------------------------------


def _jittery(rng: random.Random, taken: list[float]) -> list[float]:
    """Frame by frame, each held back by a random delay; now and then by a long one."""
    jitter = rng.choice((0.2e-3, 1e-3, 4e-3))
    return [
        t + rng.uniform(0.0, jitter) + (rng.expovariate(1 / 20e-3) if rng.random() < 0.005 else 0.0)
        for t in taken
    ]


def _batched(rng: random.Random, taken: list[float]) -> list[float]:
    """As a USB adapter sends them: all of one period together, then up to 0.2 ms later."""
    period = rng.choice((1.013e-3, 4.03e-3, 8.07e-3, 15.97e-3))
    late = {n: rng.uniform(0.0, 0.2e-3) for n in range(int(taken[-1] / period) + 2)}
    return [(int(t / period) + 1) * period + late[int(t / period)] for t in taken]


def _stall(rng: random.Random, seconds: float) -> tuple[float, float]:
    """When the host stands still, if it does."""
    start = rng.uniform(0.0, seconds)
    return start, start + (rng.choice((0.05, 0.3, 2.0)) if rng.random() < 0.3 else 0.0)


def _stalled(stall: tuple[float, float], received: list[float]) -> list[float]:
    """What came while the host stood still is received at its end."""
    start, end = stall
    return [end if start <= t < end else t for t in received]


def _in_order(received: list[float]) -> list[float]:
    latest, ordered = 0.0, []
    for t in received:
        latest = max(latest, t)
        ordered.append(latest)
    return ordered
