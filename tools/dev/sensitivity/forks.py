"""Diagnoses with one number halved or doubled, forked from the one with the numbers as they are.

Two savings, both exact:

- Until a number is read, a diagnosis does not depend on it. So the diagnosis forks where a number
  is first read: a child goes on from there with another value of it.
- A child hands over from room to room what its parent does. Where that is the same, bit for bit,
  after the last place at which the parent reads the number, the rest is the same, too. The child
  ends there.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gritd.tools.cli.offspring import bind_to
from gritd.tools.dev.sensitivity.numbers import Field, changed, watched
from gritd.tools.dev.sensitivity.outcome import Diagnose, DiagnosisOutcome

Report = Callable[["SensitivityCase", DiagnosisOutcome | None, float], None]


@dataclass(frozen=True)
class SensitivityCase:
    """A campaign to diagnose with one number times a factor."""

    campaign: str
    field: Field
    factor: float


@dataclass
class BaseDiagnosis:
    """A diagnosis with the numbers as they are.

    last: of each number that it reads, how many rooms had handed on when it was read last.
    digests: of what the rooms hand on.
    """

    outcome: DiagnosisOutcome = field(default_factory=lambda: DiagnosisOutcome("failed"))
    last: dict[Field, int] = field(default_factory=dict)
    digests: list[bytes] = field(default_factory=list)
    seconds: float = 0.0


def read_by(diagnose: Diagnose, folder: Path) -> BaseDiagnosis:
    """A diagnosis with the numbers as they are, what it reads and hands on, and its seconds."""
    reading, began = BaseDiagnosis(), time.process_time()

    def noticed(number: Field) -> None:
        reading.last[number] = len(reading.digests)

    with watched(noticed):
        reading.outcome = diagnose(folder, lambda *all_of: reading.digests.append(_digest(all_of)))
    reading.seconds = time.process_time() - began
    return reading


def _digest(handed: tuple[Any, ...]) -> bytes:
    """Of all that is in the values: what differs in anything differs here."""
    return hashlib.blake2b(pickle.dumps(handed, 5)).digest()


class Forks:
    """A diagnosis that forks a child for every case, where the case's number is first read.

    jobs: how many processes work at once; report: is called in the child with its case, its outcome
    and its seconds; no outcome means that nothing moved; end: [s], as time.monotonic counts, after
    which nothing is forked.
    """

    def __init__(
        self,
        reading: BaseDiagnosis,
        cases: Collection[SensitivityCase],
        jobs: int,
        report: Report,
        end: float,
    ) -> None:
        self._reading, self._report, self._end = reading, report, end
        self._cases: dict[
            Field, list[tuple[SensitivityCase, Any]]
        ] = {}  # with the number's other value
        for case in cases:
            value = changed(case.field.value, case.field.unit, case.factor)
            self._cases.setdefault(case.field, []).append((case, value))
        self._places, self._children = jobs, set[int]()
        self._case: SensitivityCase | None = None  # of a child
        self._handed = 0  # how often a room has handed on

    def run(self, diagnose: Diagnose, folder: Path) -> None:
        """Ends when all children have ended; ends them if it is interrupted."""

        with watched(self._first_read) as self._change:
            try:
                outcome = self._run(diagnose, folder)
                if self._case:
                    self._leave(outcome)
                self._wait(0)
            finally:
                if self._case:  # whatever ended a child, it must not go on as its parent does
                    os._exit(1)
                self._end_children()

    def _run(self, diagnose: Diagnose, folder: Path) -> DiagnosisOutcome:
        try:
            return diagnose(folder, self._compare)
        except Exception as error:  # a child's number may break what no real value does
            if self._case is None:
                raise
            return DiagnosisOutcome(f"failed: {type(error).__name__}")

    def _first_read(self, number: Field) -> None:
        """Before the number is read: the children go on from here."""
        if self._case or number not in self._cases:
            return

        for case, value in self._cases.pop(number):
            if time.monotonic() > self._end:
                return
            self._fork(case)
            if self._case:
                self._change(number, value)
                return

    def _fork(self, case: SensitivityCase) -> None:
        parent = os.getpid()
        if child := os.fork():
            self._children.add(child)
            self._wait(self._places - 1)
            return

        bind_to(parent)
        self._case, self._children = case, set()

    def _wait(self, most: int) -> None:
        """Until no more than so many children are left."""
        while len(self._children) > most:
            pid, _ = os.wait()
            self._children.discard(pid)

    def _compare(self, *handed: Any) -> None:
        """What a room hands on. A child ends if its number is not read after it and it is as it
        was.
        """
        before, self._handed = self._handed, self._handed + 1
        if self._case is None or self._reading.last[self._case.field] != before:
            return
        if _digest(handed) == self._reading.digests[before]:
            self._leave(None)

    def _leave(self, outcome: DiagnosisOutcome | None) -> None:
        """The end of a child, without what its parent does at its own end."""
        assert self._case
        try:
            self._report(self._case, outcome, time.process_time())
        finally:
            os._exit(0)

    def _end_children(self) -> None:
        for child in self._children:
            os.kill(child, signal.SIGKILL)
        self._wait(0)
