"""What is fuzzed, how often, and whether it is answered rightly."""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gritd.drivers.framing_ascii import AsciiFraming
from gritd.drivers.framing_ascii import encode as encode_ascii
from gritd.drivers.framing_cobs import CobsFraming
from gritd.drivers.framing_cobs import encode as encode_cobs
from gritd.tools.cli.progress import Progress
from gritd.tools.dev.fuzz.case import Case
from gritd.tools.dev.fuzz.commands import file_arguments, text_arguments
from gritd.tools.dev.fuzz.files import configurations, recordings, truncations
from gritd.tools.dev.fuzz.readings import wild_inputs
from gritd.tools.dev.fuzz.wire import can_messages, databases, serial_stream

SHOWN = 5  # failures reported in full


@dataclass(frozen=True)
class Target:
    """What is fuzzed, how often in the full run, and how to make the thing that runs one case."""

    name: str
    cases: int
    make: Callable[[Path], Case]


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


TARGETS = (
    Target("framing cobs", 500_000, lambda _: serial_stream(CobsFraming, encode_cobs)),
    Target("framing ascii", 500_000, lambda _: serial_stream(AsciiFraming, encode_ascii)),
    Target("CAN messages", 100_000, can_messages),
    Target("CAN databases", 2_000, databases),
    Target("configuration", 10_000, configurations),
    Target("recordings mutated", 100_000, recordings),
    Target("recordings cut at every byte", 4_000, truncations),
    Target("filter, wild inputs", 100_000, wild_inputs),
    Target("file arguments of the commands", 5_000, file_arguments),
    Target("text arguments of the commands", 5_000, text_arguments),
)
