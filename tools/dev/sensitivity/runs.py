"""All that has been diagnosed, kept in a file of JSON lines as it comes."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import os
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gritd
from gritd.tools.dev.sensitivity.forks import BaseDiagnosis, Forks, SensitivityCase, read_by
from gritd.tools.dev.sensitivity.numbers import Field, every_field, named
from gritd.tools.dev.sensitivity.outcome import Diagnose, DiagnosisOutcome, Moved, diagnosed

HOME = Path(gritd.__file__).parent
ENGINE = ("estimator", "tools/diagnose")  # what a diagnosis is made of


@dataclass
class DiagnosedRuns:
    """What has been diagnosed so far, by the campaigns' names; spent: seconds of each case."""

    before: dict[str, DiagnosisOutcome] = field(default_factory=dict)
    read: dict[str, frozenset[Field]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    moved: dict[SensitivityCase, Moved] = field(default_factory=dict)
    spent: dict[SensitivityCase, float] = field(default_factory=dict)

    def cases(self, only: Collection[str] = ()) -> list[SensitivityCase]:
        """Those that can move anything, of the numbers that are asked for."""
        asked = [f for f in every_field() if not only or str(f) in only]
        return [
            SensitivityCase(campaign, f, factor)
            for campaign in self.campaigns()
            for f in asked
            if f in self.read[campaign]
            for factor in f.factors()
        ]

    def campaigns(self) -> list[str]:
        """The cheapest first."""
        return sorted(self.read, key=lambda name: self.seconds[name])


def run(
    folders: Sequence[Path],
    kept: Path,
    only: Collection[str] = (),
    jobs: int = 1,
    minutes: float = math.inf,
    diagnose: Diagnose = diagnosed,
) -> Iterator[DiagnosedRuns]:
    """Every campaign with every number halved and doubled, as far as the time goes; gives what the
    file holds after each campaign. What it holds already is not run again.

    Raises ValueError if the file is of another version of the engine.
    """
    end = time.monotonic() + 60.0 * minutes
    file = Kept(kept)
    for folder in folders:
        runs = file.runs()
        name = folder.name
        if name in runs.read and not _left(runs, name, only):
            continue
        if time.monotonic() > end:
            return

        reading = read_by(diagnose, folder)
        file.keep_reading(name, reading)
        left = _left(file.runs(), name, only)
        Forks(reading, left, jobs, file.keep, end).run(diagnose, folder)
        yield file.runs()


def _left(runs: DiagnosedRuns, campaign: str, only: Collection[str]) -> list[SensitivityCase]:
    return [c for c in runs.cases(only) if c.campaign == campaign and c not in runs.moved]


class Kept:
    """The file. Its first line names the version of the engine and the day on which it began."""

    def __init__(self, path: Path) -> None:
        self._path = path
        if not path.exists():
            self._add({"engine": engine(), "begun": time.strftime("%Y-%m-%d", time.gmtime())})
        if (of := self._lines()[0]["engine"]) != engine():
            raise ValueError(f"{path}: made by another version of the engine, {of}")

    def keep_reading(self, campaign: str, reading: BaseDiagnosis) -> None:
        self._add(
            {
                "campaign": campaign,
                "before": dataclasses.asdict(reading.outcome),
                "read": sorted(str(f) for f in reading.last),
                "seconds": round(reading.seconds, 2),
            }
        )

    def keep(self, case: SensitivityCase, outcome: DiagnosisOutcome | None, seconds: float) -> None:
        """outcome: None where nothing moved. One write, so that children may write at once."""
        after = dataclasses.asdict(outcome) if outcome else None
        line = {"campaign": case.campaign, "number": str(case.field), "factor": case.factor}
        self._add({**line, "after": after, "seconds": round(seconds, 2)})

    def runs(self) -> DiagnosedRuns:
        """All that the file holds."""
        runs = DiagnosedRuns()
        for line in self._lines()[1:]:
            if "before" in line:
                name = line["campaign"]
                runs.before[name] = _outcome(line["before"])
                runs.read[name] = frozenset(named(text) for text in line["read"])
                runs.seconds[name] = line["seconds"]
            else:
                _add_case(runs, line)

        return runs

    @property
    def begun(self) -> str:
        return str(self._lines()[0]["begun"])

    def _lines(self) -> list[dict[str, Any]]:
        text = self._path.read_text(encoding="utf-8")
        return [json.loads(line) for line in text.splitlines()]

    def _add(self, line: Mapping[str, Any]) -> None:
        file = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            os.write(file, (json.dumps(line) + "\n").encode())
        finally:
            os.close(file)


def _outcome(line: Mapping[str, Any]) -> DiagnosisOutcome:
    return DiagnosisOutcome(**{**line, "accepted": tuple(line["accepted"])})


def _add_case(runs: DiagnosedRuns, line: Mapping[str, Any]) -> None:
    case = SensitivityCase(line["campaign"], named(line["number"]), line["factor"])
    before = runs.before[case.campaign]
    runs.moved[case] = Moved.between(before, _outcome(line["after"]) if line["after"] else before)
    runs.spent[case] = line["seconds"]


def engine() -> str:
    """What tells one version of the engine from another: a digest of its files."""
    digest = hashlib.blake2b(digest_size=8)
    for folder in ENGINE:
        for path in sorted((HOME / folder).rglob("*")):
            if path.suffix in (".py", ".json"):
                digest.update(path.read_bytes())
    return digest.hexdigest()
