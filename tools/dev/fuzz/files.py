"""Configurations and recordings that are damaged."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from itertools import count
from pathlib import Path

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.configuration import ConfigError
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.tools.dev.fuzz.case import START, Case, mutated

ERROR_LINE = re.compile(r"rig\.yaml:\d+: .+: found .+; expected .+", re.DOTALL)


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
