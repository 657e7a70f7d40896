"""What a proof hands back: diagnoses, the judge's questions, figures before and after."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.proof.real.bench import CommandBench, DiagnosisRun


@dataclass(frozen=True)
class Check:
    """One question of the judge. `reason`: why it was missed, as far as it was found out; shown
    only if it was.
    """

    question: str
    wanted: str
    answer: str
    met: bool
    reason: str = ""


@dataclass(frozen=True)
class FigureTable:
    """Figures: a heading for each column, and rows of text."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Panel:
    """One drawing over x: the concealed truth, what stood without the diagnosis, and with it; rows
    of (4, n).
    """

    title: str
    curves: Array
    x_label: str
    y_label: str
    labels: tuple[str, str, str]
    points: bool = False  # markers for conditions; lines over time otherwise


@dataclass(frozen=True)
class Finding:
    diagnoses: Sequence[DiagnosisRun]  # quoted unedited
    checks: Sequence[Check]
    table: FigureTable
    panels: Sequence[Panel]


@dataclass(frozen=True)
class Proof:
    """Prose may be broken into lines anywhere. `run` raises CommandError where a command fails."""

    name: str  # of its figure, and for --only
    rig: str  # folder of the data
    title: str
    concealed: str  # what was kept back, and who judges
    saw: str  # what the tool was given
    run: Callable[[CommandBench], Finding]


def listed(names: Iterable[str]) -> str:
    """Names in a sentence."""
    return ", ".join(names)
