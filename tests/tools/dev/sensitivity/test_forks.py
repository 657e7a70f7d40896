"""A diagnosis that is forked where a number is first read ends as one from the beginning does."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.tools.dev.sensitivity.forks import BaseDiagnosis, Forks, SensitivityCase, read_by
from gritd.tools.dev.sensitivity.numbers import Field, changed, named
from gritd.tools.dev.sensitivity.outcome import Diagnose, DiagnosisOutcome, Handed, decided
from gritd.tools.dev.sensitivity.runs import Kept
from gritd.tools.diagnose.tuning import TUNING, replaced
from gritd.tools.proof.ours.cases import rig_of
from tests.tools.diagnose.campaigns import plan

pytestmark = pytest.mark.long

NUMBERS = (
    "orders.level",
    "rig.blur",
    "noise.floor",
    "fit.strength_prior",
    "screen.level",
    "search.little",
    "verdict.together",
)


def small(folder: Path, handed: Handed) -> DiagnosisOutcome:
    """One short run with a sinkage datum that is off."""
    acting = (make("sinkage_datum", {"offset": 0.006}),)
    drawn = plan(loads=(60.0,), seconds=6.0, standstill=False, wrench=False)
    with np.errstate(all="ignore"):
        return decided(rig_of(drawn, acting), handed)


@pytest.fixture(autouse=True, scope="module")
def _quick() -> Iterator[None]:
    with replaced("search", effects_first=1, later=()):
        yield


@pytest.fixture(scope="module")
def reading() -> BaseDiagnosis:
    return read_by(small, Path("small"))


@pytest.fixture(scope="module")
def forked(reading: BaseDiagnosis, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the children found; None where they ended early."""
    kept = tmp_path_factory.mktemp("forks") / "kept.jsonl"
    cases = [SensitivityCase("small", named(number), 2.0) for number in NUMBERS]
    Forks(reading, cases, 2, Kept(kept).keep, math.inf).run(small, Path("small"))
    lines = [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()[1:]]
    return {line["number"]: line["after"] for line in lines}


@pytest.mark.parametrize("number", NUMBERS)
def test_a_fork_ends_as_a_diagnosis_from_the_beginning(
    number: str, reading: BaseDiagnosis, forked: dict[str, Any]
) -> None:
    of = named(number)
    with replaced(of.room, **{of.name: changed(of.value, of.unit, 2.0)}):
        fresh = small(Path("small"), lambda *_: None)
    after = forked[number] or asdict(reading.outcome)
    assert json.dumps(after) == json.dumps(asdict(fresh))


def test_some_numbers_move_something_and_some_end_early(
    forked: dict[str, Any],
) -> None:
    early = [name for name, outcome in forked.items() if outcome is None]
    assert 0 < len(early) < len(forked)


def test_the_numbers_are_as_they_were(forked: dict[str, Any]) -> None:
    assert type(TUNING.rig).__name__ == "RigTuning"


def test_a_child_does_not_end_while_its_number_is_still_read(tmp_path: Path) -> None:
    """The first room hands on the same; the number counts in the second."""

    def late(folder: Path, handed: Handed) -> DiagnosisOutcome:
        assert TUNING.verdict.odds > 0.0
        handed("the same")
        tan_phi = TUNING.verdict.odds
        handed(tan_phi)
        return DiagnosisOutcome("consistent", tan_phi=tan_phi, sigma=1.0)

    odds = Field("verdict", "odds")
    (line,) = _kept(tmp_path, late, odds, read_by(late, tmp_path))
    assert line["after"]["tan_phi"] == pytest.approx(0.3)


def test_a_number_that_breaks_a_diagnosis_is_said(tmp_path: Path) -> None:
    def breaks(folder: Path, handed: Handed) -> DiagnosisOutcome:
        if TUNING.verdict.odds > 0.2:
            raise TypeError
        return DiagnosisOutcome("consistent")

    (line,) = _kept(tmp_path, breaks, Field("verdict", "odds"))
    assert line["after"]["verdict"] == "failed: TypeError"


def test_children_end_with_a_run_that_is_interrupted(tmp_path: Path) -> None:
    """The parent stops; its child waits for ever."""
    parent, read, write = os.getpid(), *os.pipe()

    def stops(folder: Path, handed: Handed) -> DiagnosisOutcome:
        assert TUNING.verdict.odds
        if os.getpid() != parent:
            os.close(read)
            os.read(os.pipe()[0], 1)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _kept(tmp_path, stops, Field("verdict", "odds"), jobs=2)
    os.close(write)
    assert os.read(read, 1) == b""  # the child's end is closed, too
    os.close(read)


def _kept(
    folder: Path,
    diagnose: Diagnose,
    number: Field,
    reading: BaseDiagnosis | None = None,
    jobs: int = 1,
) -> list[dict[str, Any]]:
    """What a diagnosis with twice the number says; reading: by default it hands on nothing."""
    path, case = folder / "kept.jsonl", SensitivityCase("small", number, 2.0)
    reading = reading or BaseDiagnosis(last={number: 0})
    Forks(reading, [case], jobs, Kept(path).keep, math.inf).run(diagnose, folder)
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()[1:]]
