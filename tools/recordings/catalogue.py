"""The runs of a folder: what each was and how it ended, from a first look at its files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gritd.estimator.config.yamltree import ConfigError, Scalar, compose
from gritd.estimator.config.yamltree import Mapping as YamlMapping
from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.glance import glance
from gritd.estimator.recording.parts import parts
from gritd.estimator.recording.recording import Recording
from gritd.estimator.recording.tables import Fields

NS = 1e-9
CHUNKS = 1  # besides the first, and those at the end
SOIL = ("cohesion", "cohesion_sigma", "tan_phi", "tan_phi_sigma")
TICK, ENCODER = "/tick", "/raw/wheel_encoder"
TABLES: Mapping[str, Fields] = {TICK: ("stamp", "status", "flags", *SOIL), ENCODER: ("stamp",)}
PART = re.compile(r"(?P<run>.+)\.[1-9][0-9]*\.mcap")
NO_TICKS = "no ticks"


@dataclass(frozen=True)
class RunEntry:
    """One run over all its parts. SI units; None where it is not known."""

    path: Path  # of its first part
    parts: int
    size: int  # [bytes]
    name: str
    testbed: str
    operator: str
    notes: str
    bed: str
    load: float | None  # [N], as stated
    start: int | None  # [ns]
    duration: float | None  # [s]
    status: str  # at the end
    cohesion: float | None = None  # [Pa], at the end, as the ones below
    cohesion_sigma: float | None = None
    tan_phi: float | None = None
    tan_phi_sigma: float | None = None


def runs_of(folder: Path) -> list[Path]:
    """The first parts of the runs in a folder and the folders in it, by name."""
    found = sorted(path for path in folder.rglob("*.mcap") if path.is_file())
    return [path for path in found if not _continues(path)]


def _continues(path: Path) -> bool:
    """Whether a file is a later part of a run that lies beside it."""
    match = PART.fullmatch(path.name)
    return bool(match and path.with_name(f"{match['run']}.mcap").is_file())


def entry(path: Path) -> RunEntry:
    """Of a run's first part. Raises RecordingError, OSError."""
    files = parts(path)
    first = glance(path, TABLES, CHUNKS)
    last = first if len(files) == 1 else glance(files[-1], TABLES, CHUNKS)
    run = first.run

    return RunEntry(
        path=path,
        parts=len(files),
        size=sum(file.stat().st_size for file in files),
        name=run.name,
        testbed=testbed_of(first),
        operator=run.operator,
        notes=run.notes,
        bed=run.bed,
        load=run.nominal_load,
        **_course(first, last),
    )


def testbed_of(recording: Recording) -> str:
    """The name of the testbed in the recorded configuration; empty where there is none."""
    try:
        tree = compose(recording.config_yaml or "", str(recording.path))
    except ConfigError:
        return ""
    named = tree.items.get("testbed") if isinstance(tree, YamlMapping) else None
    return named.text if isinstance(named, Scalar) else ""


def _course(first: Recording, last: Recording) -> dict[str, Any]:
    """When the run began, how long it took, and how it ended."""
    topic = TICK if last.counts[TICK] else ENCODER
    begun, ended = _rows(first, topic), _rows(last, topic)
    if begun is None or ended is None:
        return {"start": None, "duration": None, "status": NO_TICKS}

    start, end = int(begun["stamp"][0]), int(ended["stamp"][-1])
    course = {"start": start, "duration": (end - start) * NS, "status": NO_TICKS}
    if topic == ENCODER:
        return course

    row = {name: ended[name][-1] for name in ("status", "flags", *SOIL)}
    believed = "" if not int(row["flags"]) & Flag.PRIOR else " PRIOR"
    soil = {name: float(row[name]) for name in SOIL}
    number = int(row["status"])
    status = Status(number).name if number in tuple(Status) else f"status {number}"
    return {**course, **soil, "status": status + believed}


def _rows(of: Recording, topic: str) -> Rows | None:
    """What was found of a topic; None where that is nothing."""
    rows = of.tables({topic: TABLES[topic]})[topic] if of.counts[topic] else None
    return rows if rows is not None and rows.size else None


def chosen(entries: Sequence[RunEntry], wanted: Mapping[str, Any]) -> Iterator[RunEntry]:
    """Those that fit: testbed, status, and text (in name, notes, operator, bed or path) by their
    letters, load within 5 %.
    """
    for each in entries:
        text = " ".join((str(each.path), each.name, each.notes, each.operator, each.bed))
        load, near = wanted.get("load"), each.load
        if (
            _holds(each.testbed, wanted.get("rig"))
            and _holds(each.status, wanted.get("status"))
            and _holds(text, wanted.get("text"))
            and (load is None or (near is not None and abs(near - load) <= 0.05 * load))
        ):
            yield each


def _holds(text: str, wanted: str | None) -> bool:
    return wanted is None or wanted.casefold() in text.casefold()
