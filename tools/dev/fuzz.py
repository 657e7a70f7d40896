"""Inputs that nobody meant, at every place where bytes or values come in: `python -m
gritd.tools.dev.fuzz [--share 0.01]`.

Seeded and bounded. Each target makes a case from a random generator, hands it over, and says in a
line what is wrong with the answer; an exception that is not the stated one is wrong too.
"""

from __future__ import annotations

import math
import random
import re
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count, cycle
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.drivers.build import build_decoder
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import Frame, Framing
from gritd.drivers.framing_ascii import AsciiFraming
from gritd.drivers.framing_ascii import encode as encode_ascii
from gritd.drivers.framing_can import pack
from gritd.drivers.framing_cobs import CobsFraming
from gritd.drivers.framing_cobs import encode as encode_cobs
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.config.settings import ENGINES, Settings
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.online.pipeline import Pipeline, State
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import DONE, FAILED, Parser
from gritd.tools.cli.progress import Progress

NS = 1_000_000_000
START = 1_700_000_000 * NS
SHOWN = 5  # failures told in full
ERROR_LINE = re.compile(r"rig\.yaml:\d+: .+: found .+; expected .+", re.DOTALL)
ESTIMATE = [TICK_NAMES.index(name) for name in ("cohesion", "tan_phi", "shear_modulus")]
SIGMAS = [TICK_NAMES.index(f"{name}_sigma") for name in ("cohesion", "tan_phi", "shear_modulus")]

Case = Callable[[random.Random], str]
"""Runs one case; '' or what is wrong."""


@dataclass(frozen=True)
class Target:
    """What is fuzzed, how often in the full run, and how to make the thing that runs one case."""

    name: str
    cases: int
    make: Callable[[Path], Case]


def main(argv: Sequence[str] | None = None) -> int:
    """Exit 1 if any case of any target is answered wrongly."""
    parser = Parser(
        prog="python -m gritd.tools.dev.fuzz",
        description="Fuzz every place where bytes or values come in.",
    )
    parser.add_argument(
        "--share", type=float, default=1.0, help="of the full number of cases; default 1"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", metavar="WORD", default="", help="targets whose name holds this")

    arguments = parser.parse_args(argv)

    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for target in TARGETS:
            if arguments.only in target.name:
                failed += run(
                    target,
                    max(1, round(target.cases * arguments.share)),
                    arguments.seed,
                    Path(folder),
                )

    return FAILED if failed else DONE


def run(target: Target, cases: int, seed: int, folder: Path) -> int:
    """Run the cases of one target; how many failed."""
    case, failed, began = target.make(folder), 0, time.monotonic()

    with Progress(target.name, cases) as progress:
        for number in range(cases):
            wrong = answered(case, random.Random(f"{seed}/{target.name}/{number}"))
            failed += bool(wrong)
            if wrong and failed <= SHOWN:
                print(f"{target.name}, case {number}: {wrong}", file=sys.stderr, flush=True)
            progress.advance()

    print(
        f"{target.name}: {cases} cases, {failed} failed, {time.monotonic() - began:.0f} s",
        flush=True,
    )

    return failed


def answered(case: Case, rng: random.Random) -> str:
    try:
        return case(rng)
    except Exception as error:  # whatever it is: it was not stated
        return f"{type(error).__name__}: {str(error)[:200]}"


def mutated(data: bytes, rng: random.Random, most: int = 8) -> bytes:
    """Bytes flipped, cut out, repeated, put in or thrown away at the end, up to `most` times."""
    for _ in range(rng.randint(1, most)):
        at, length = rng.randrange(len(data) + 1), rng.randint(1, 16)
        kind = rng.randrange(5)

        if kind == 0 and at < len(data):
            data = data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
        elif kind == 1:
            data = data[:at] + data[at + length :]
        elif kind == 2:
            data = data[:at] + data[at : at + length] * rng.randint(1, 4) + data[at + length :]
        elif kind == 3:
            data = data[:at] + rng.randbytes(length) + data[at:]
        elif rng.random() < 0.2:
            data = data[:at]

    return data


# --- bytes of sensors ---


def serial_stream(framing: Callable[[], Framing], encode: Callable[[Frame], bytes]) -> Case:
    """A few frames, damaged, cut into chunks: survived, and afterwards an intact frame is still
    read.
    """
    probe = [encode(Frame("wheel", number, 7, (1234,))) for number in range(2)]

    def case(rng: random.Random) -> str:
        decoder = framing()
        frames = [
            Frame("pot", n, rng.randrange(1 << 32), (rng.random(),))
            for n in range(rng.randint(1, 3))
        ]

        data = mutated(b"".join(map(encode, frames)), rng)
        cut = rng.randrange(len(data) + 1)
        decoder.decode(data[:cut])
        decoder.decode(data[cut:])

        intact = [frame for piece in probe for frame in decoder.decode(piece)]

        return (
            ""
            if any(frame.values == (1234,) for frame in intact)
            else "no intact frame is read after the damage"
        )

    return case


def can_messages(_: Path) -> Case:
    """Wanted and unwanted ids with any payload and length, through framing, clock and sensors, one
    decoder for all.
    """
    settings = config.load(packaged()).settings
    decoder = build_decoder(settings, settings.devices["bus"])
    ids = [0x110, 0x111, 0x112, 0x120, 0x121, 0x7FF]

    def case(rng: random.Random) -> str:
        word = rng.choice(ids) if rng.random() < 0.9 else rng.getrandbits(32)
        payload = rng.randbytes(rng.choice((8, 8, 8, 6, rng.randint(0, 64))))
        readings = decoder.decode(START + rng.randrange(NS), pack(word, payload))
        wild = [r for r in readings if not all(map(math.isfinite, values_of(r)))]
        return f"a value that is not finite: {wild}" if wild else ""

    return case


def values_of(reading: Reading) -> tuple[float, ...]:
    return reading.value if isinstance(reading.value, tuple) else (float(reading.value),)


def databases(folder: Path) -> Case:
    """A damaged DBC file: read, or refused in one line."""
    settings = config.load(packaged()).settings
    device = settings.devices["bus"]
    good = Path(device.dbc).read_bytes()
    path = folder / "fuzz.dbc"

    def case(rng: random.Random) -> str:
        path.write_bytes(mutated(good, rng, 3))
        try:
            build_decoder(settings, replace(device, dbc=str(path)))
        except DeviceSettingsError as error:
            return "" if "\n" not in str(error) else f"more than one line: {error}"
        return ""

    return case


# --- configuration ---


def configurations(_: Path) -> Case:
    """A damaged configuration: settings, or one line with file, line and key."""
    good = Path(packaged()).read_bytes()

    def case(rng: random.Random) -> str:
        text = mutated(good, rng, 4).decode(errors="replace")
        try:
            config.loads(text, "rig.yaml", Path(packaged()).parent)
        except ConfigError as error:
            return "" if ERROR_LINE.fullmatch(str(error)) else f"not the promised line: {error}"
        return ""

    return case


# --- recordings ---


def small_recording(path: Path) -> list[str]:
    """A closed recording of a few chunks; its messages as text."""
    writer = RunWriter(path, (), "a: 1\n", RunInfo("fuzz"))
    for number in range(24):
        writer.reading(Reading(START + number, "sinkage_pot", number / 7, START + number))
        if number % 8 == 7:
            writer.flush()
    writer.close()
    return [repr(message) for message in read(path).messages()]


def checked(path: Path, written: Sequence[str], prefix: bool) -> str:
    """What is read must have been written, in this order; what is missing must be said."""
    try:
        recording = read(path)
        messages = [repr(message) for message in recording.messages()]
    except RecordingError as error:
        return "" if "\n" not in str(error) else f"more than one line: {error}"
    if prefix and messages != written[: len(messages)]:
        return "not a prefix"
    if not set(messages) <= set(written):
        return f"a message that was not written: {(set(messages) - set(written)).pop()}"
    return (
        "a loss that is not reported" if len(messages) < len(written) and recording.complete else ""
    )


def recordings(folder: Path) -> Case:
    written = small_recording(folder / "mutated.mcap")
    good, path = (folder / "mutated.mcap").read_bytes(), folder / "case.mcap"

    def case(rng: random.Random) -> str:
        path.write_bytes(mutated(good, rng))
        return checked(path, written, prefix=False)

    return case


def truncations(folder: Path) -> Case:
    """One cut after the other, at every byte, from the start again when all are done."""
    written = small_recording(folder / "cut.mcap")
    good, path, cuts = (folder / "cut.mcap").read_bytes(), folder / "case.mcap", count()

    def case(_: random.Random) -> str:
        path.write_bytes(good[: next(cuts) % (len(good) + 1)])
        return checked(path, written, prefix=True)

    return case


# --- the filter ---

WILD = (0.0, -0.0, 1e-300, 1e300, -1e300, math.inf, -math.inf, math.nan, 1e-9, 5.0, -5.0)


def wild_inputs(_: Path) -> Case:
    """Twelve ticks of anything: values, stamps, orders, gaps. Estimates stay finite, sure of
    nothing false, in bounds. The engines take turns.

    One run in four goes on from the one before, so that the filter is met in every state it can be
    brought into.
    """
    settings = quick(config.load(packaged()).settings)
    pipelines = cycle(Pipeline(settings, engine) for engine in ENGINES)
    running: list[tuple[State, int]] = []

    def case(rng: random.Random) -> str:
        pipeline = next(pipelines)
        state, t = running.pop() if running and rng.random() < 0.25 else (pipeline.start(), START)
        sane = rng.random() < 0.7  # mostly plausible with wild ones in between: those get furthest
        for number in range(12):
            t += (
                rng.choice((0, 1, NS // 10, NS // 10, NS // 10, NS, 100 * NS))
                if rng.random() < 0.2
                else NS // 10
            )

            state, record = pipeline.step(state, wild_readings(rng, t, number, sane), t)
            if wrong := unfit(record, state, settings):
                return f"tick {number}: {wrong}"

        running[:] = [(state, t)]
        return ""

    return case


def quick(settings: Settings) -> Settings:
    """Ten ticks a second, so that every one of them is an update."""
    return replace(settings, rates=replace(settings.rates, tick=20.0))


def wild_readings(rng: random.Random, t: int, number: int, sane: bool) -> list[Reading]:
    """A window of readings of all channels; plausible ones, or anything."""
    readings = []
    for place in range(5):
        stamp = t - NS // 20 - place * NS // 50

        plain: dict[str, int | float | tuple[float, ...]] = {
            "wheel_encoder": number * 313 - place * 62,
            "carriage_encoder": number * 16 - place * 3,
            "sinkage_pot": 1.3 + rng.gauss(0, 2e-3),
            "motor_shunt": 3.2 + rng.gauss(0, 2e-3),
            "wrench": (10.0, 0.0, 70.0 + rng.gauss(0, 0.3), 0.0, 2.0, 0.0),
            "motor_temperature": 20.0,
        }

        for channel, value in plain.items():
            wild = rng.random() < (0.02 if sane else 0.6)
            readings.append(
                Reading(
                    wild_stamp(rng, stamp, wild),
                    channel,
                    wild_value(rng, value) if wild else value,
                    t,
                )
            )

    rng.shuffle(readings)
    return readings


def wild_stamp(rng: random.Random, stamp: int, wild: bool) -> int:
    return (
        stamp + rng.choice((0, 0, 1, -NS, NS, rng.randrange(-(10**18), 10**18))) if wild else stamp
    )


def wild_value(
    rng: random.Random, value: int | float | tuple[float, ...]
) -> int | float | tuple[float, ...]:
    if isinstance(value, tuple):
        return tuple(rng.choice((*WILD, float(part), rng.gauss(0, 100))) for part in value)
    if isinstance(value, int):
        return rng.choice((0, value + 1, -(2**62), 2**62, rng.randrange(-(2**40), 2**40)))
    return rng.choice((*WILD, rng.gauss(0, 10)))


def unfit(record: Sequence[float], state: State, settings: Settings) -> str:
    """What is wrong with a tick: a non-finite estimate, one out of bounds, a covariance that is
    none.
    """
    if not all(math.isfinite(record[place]) for place in (*ESTIMATE, *SIGMAS)):
        return f"not finite: {[record[place] for place in (*ESTIMATE, *SIGMAS)]}"

    bounds = settings.filter
    limits = (bounds.cohesion_bounds, bounds.tan_phi_bounds, bounds.shear_modulus_bounds)
    for place, (low, high) in zip(ESTIMATE, limits, strict=True):
        if not low * (1 - 1e-9) <= record[place] <= high * (1 + 1e-9):
            return f"{TICK_NAMES[place]} is {record[place]}, outside [{low}, {high}]"

    covariance = np.array(state.track.estimate.P)
    if not np.array_equal(covariance, covariance.T):
        return "covariance not symmetric"

    lowest = float(np.linalg.eigvalsh(covariance)[0])
    return "" if lowest > 0.0 else f"covariance not positive definite: {lowest}"


TARGETS = (
    Target("framing cobs", 500_000, lambda _: serial_stream(CobsFraming, encode_cobs)),
    Target("framing ascii", 500_000, lambda _: serial_stream(AsciiFraming, encode_ascii)),
    Target("CAN messages", 100_000, can_messages),
    Target("CAN databases", 2_000, databases),
    Target("configuration", 10_000, configurations),
    Target("recordings mutated", 100_000, recordings),
    Target("recordings cut at every byte", 4_000, truncations),
    Target("filter, wild inputs", 100_000, wild_inputs),
)


if __name__ == "__main__":
    sys.exit(main())
