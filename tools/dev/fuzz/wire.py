"""Bytes of sensors, and the databases that say how to read them."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gritd.config import packaged
from gritd.drivers.build import build_decoder, keys_of
from gritd.drivers.can_signals import amiss_elsewhere
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import Frame, Framing
from gritd.drivers.framing_can import pack
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.readings import NS, Reading
from gritd.tools.dev.fuzz.case import START, Case, mutated

NUMBER = re.compile(rb"\d+")
WILD = (b"0", b"-5", b"1e999", b"1000000000", b"99999999999999999999", b"nan", b"")


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
    ids = [0x110, 0x111, 0x112, 0x120, 0x121, 0x122, 0x7FF]

    def case(rng: random.Random) -> str:
        word = rng.choice(ids) if rng.random() < 0.9 else rng.getrandbits(32)
        payload = rng.randbytes(rng.choice((8, 8, 8, 6, rng.randint(0, 64))))
        readings = decoder.decode(START + rng.randrange(NS), pack(word, payload))
        wild = [r for r in readings if not all(map(math.isfinite, values_of(r)))]
        return f"a value that is not finite: {wild}" if wild else ""

    return case


def values_of(reading: Reading) -> tuple[float, ...]:
    return reading.value if isinstance(reading.value, tuple) else (float(reading.value),)


def _wild(text: bytes, rng: random.Random) -> bytes:
    """A few numbers of a text replaced by ones that cannot be."""
    places = {match.start() for match in rng.sample(list(NUMBER.finditer(text)), 3)}
    return NUMBER.sub(lambda m: rng.choice(WILD) if m.start() in places else m[0], text)


def databases(folder: Path) -> Case:
    """A damaged DBC file, or one with impossible numbers: read, or refused in one line."""
    settings = config.load(packaged()).settings
    device = settings.devices["bus"]
    good = Path(device.dbc).read_bytes()
    path = folder / "fuzz.dbc"

    def case(rng: random.Random) -> str:
        path.write_bytes(_wild(good, rng) if rng.random() < 0.5 else mutated(good, rng, 3))
        changed = replace(device, dbc=str(path))
        try:
            amiss_elsewhere(changed, keys_of(settings, device))
            build_decoder(settings, changed)
        except DeviceSettingsError as error:
            return "" if "\n" not in str(error) else f"more than one line: {error}"
        return ""

    return case
