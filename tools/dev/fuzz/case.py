"""A case of a target, and bytes that are damaged for it."""

from __future__ import annotations

import random
from collections.abc import Callable

from gritd.estimator.messages.readings import NS

START = 1_700_000_000 * NS  # [ns] of every case

Case = Callable[[random.Random], str]
"""Runs one case; '' or what is wrong."""


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
