"""How far a diagnosis moves when a tuned number is halved or doubled.

    python -m gritd.tools.dev.sensitivity CAMPAIGNS [--only NAME …] [--fields ROOM.FIELD …]
                                          [--jobs N] [--minutes M] [--out docs/sensitivity.md]

CAMPAIGNS is a folder of campaigns, each of recordings and one configuration (`twenty make`
makes some). Each campaign is diagnosed once as it is; the numbers that it reads are counted. Then
each of them is halved and doubled, one at a time. The table is written after every diagnosis.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.tools.cli.command import CommandError, Parser
from gritd.tools.cli.progress import Progress
from gritd.tools.diagnose.explain.soil import averaged_soil
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import search_models
from gritd.tools.diagnose.tuning import TUNING, replaced
from gritd.tools.diagnose.verdict.decide import decide

ODDS = ("share", "probability")  # units of numbers that stay below 1
FIXED = ("prior", "choice")  # units of what is not a size

# --- what is changed ---


@dataclass(frozen=True, order=True)
class Field:
    """A tuned number of a room."""

    room: str
    name: str

    def __str__(self) -> str:
        return f"{self.room}.{self.name}"

    @property
    def value(self) -> Any:
        return getattr(getattr(TUNING, self.room), self.name)

    @property
    def about(self) -> Mapping[str, str]:
        """Its unit, its reason, and what it was learnt from."""
        stage = getattr(TUNING, self.room)
        return next(f.metadata for f in fields(stage) if f.name == self.name)


def every_field() -> list[Field]:
    """All tuned numbers, in the order of the rooms."""
    rooms = [f.name for f in fields(TUNING)]
    return [Field(room, f.name) for room in rooms for f in fields(getattr(TUNING, room))]


def changed(value: Any, unit: str, factor: float) -> Any:
    """A number, or all numbers of a tuple or a mapping, times a factor; whole numbers rounded, one
    at least. Shares and probabilities change in their odds, quantiles in the odds of their tail.
    """
    if isinstance(value, Mapping):
        return {name: changed(each, unit, factor) for name, each in value.items()}
    if isinstance(value, tuple):
        return tuple(changed(each, unit, factor) for each in value)
    if isinstance(value, int):
        return max(math.floor(value * factor + 0.5), 1)
    if unit == "quantile" and value > 0.5:
        return 1.0 - _in_odds(1.0 - value, factor)
    return _in_odds(value, factor) if unit in (*ODDS, "quantile") else value * factor


def _in_odds(share: float, factor: float) -> float:
    return share * factor / (1.0 - share + share * factor)


# --- what it changes ---


@dataclass(frozen=True)
class Outcome:
    """What counts of a diagnosis: probabilities by effect, tan φ and its standard deviation."""

    verdict: str
    accepted: tuple[str, ...] = ()
    probabilities: Mapping[str, float] = field(default_factory=dict)
    tan_phi: float = math.nan
    sigma: float = math.nan


@dataclass(frozen=True)
class Moved:
    """A diagnosis with one number changed, against that of the numbers as they are."""

    verdict: bool
    names: bool
    probability: float
    sigmas: float

    @classmethod
    def between(cls, before: Outcome, after: Outcome) -> Moved:
        """sigmas: change of tan φ in its standard deviation before; 0 without a soil."""
        every = {*before.probabilities, *after.probabilities}
        most = max(
            (abs(before.probabilities.get(n, 0) - after.probabilities.get(n, 0)) for n in every),
            default=0.0,
        )
        apart = abs(after.tan_phi - before.tan_phi) / before.sigma if before.sigma > 0.0 else 0.0
        names = before.accepted != after.accepted
        return cls(before.verdict != after.verdict, names, most, 0.0 if apart != apart else apart)


Diagnose = Callable[[Path], Outcome]


def diagnosed(folder: Path) -> Outcome:
    """A campaign up to its verdict and soil, with the numbers in force; seed 0. What fails is said
    as a verdict.
    """
    files = sorted(folder.glob("*.mcap"))
    (configuration,) = folder.glob("*.yaml")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            return _decided(rig_of(read_all(files), config.load(configuration).settings)[0])
    except (CommandError, ArithmeticError, LookupError, ValueError) as error:
        return Outcome(f"failed: {type(error).__name__}")


def _decided(rig: Rig) -> Outcome:
    """The method without what explains a decision: that changes none of what counts here."""
    rng = np.random.default_rng(0)
    decision = decide(search_models(prepare_screening(fit_base(rig, rng), rng)))
    tan_phi = averaged_soil(rig, decision).get("tan_phi")
    return Outcome(
        decision.verdict,
        tuple(sorted(decision.best.names)),
        dict(decision.probability),
        tan_phi.value if tan_phi else math.nan,
        tan_phi.sigma if tan_phi else math.nan,
    )


class _Counted:
    """A room's numbers that notes which of them were read."""

    def __init__(self, room: str, numbers: object, read: set[Field]) -> None:
        self._room, self._numbers, self._read = room, numbers, read

    def __getattr__(self, name: str) -> Any:
        computed = getattr(type(self._numbers), name, None)
        if isinstance(computed, property) and computed.fget:
            return computed.fget(self)
        self._read.add(Field(self._room, name))
        return getattr(self._numbers, name)


def read_by(diagnose: Diagnose, folder: Path) -> tuple[Outcome, frozenset[Field], float]:
    """A diagnosis with the numbers as they are, the numbers that it read, and its seconds."""
    read: set[Field] = set()
    before = {f.name: getattr(TUNING, f.name) for f in fields(TUNING)}
    began = time.process_time()
    try:
        for room, numbers in before.items():
            setattr(TUNING, room, _Counted(room, numbers, read))
        outcome = diagnose(folder)
    finally:
        for room, numbers in before.items():
            setattr(TUNING, room, numbers)
    return outcome, frozenset(read), time.process_time() - began


# --- runs ---


@dataclass(frozen=True)
class Case:
    """A campaign to diagnose with one number times a factor."""

    folder: Path
    field: Field
    factor: float


@dataclass
class Runs:
    """What has been diagnosed so far."""

    before: dict[Path, Outcome] = field(default_factory=dict)
    read: dict[Path, frozenset[Field]] = field(default_factory=dict)
    seconds: dict[Path, float] = field(default_factory=dict)
    moved: dict[Case, Moved] = field(default_factory=dict)

    def cases(self, only: Sequence[str]) -> list[Case]:
        """Those that can move anything, number by number: what decides first, the rig last."""
        asked = [f for f in reversed(every_field()) if not only or str(f) in only]
        return [
            Case(folder, f, factor)
            for f in asked
            if f.about["unit"] not in FIXED
            for folder in sorted(self.read, key=lambda folder: self.seconds[folder])
            if f in self.read[folder]
            for factor in (0.5, 2.0)
            if changed(f.value, f.about["unit"], factor) != f.value
        ]


_diagnose: Diagnose = diagnosed  # what the children find when they are forked


def _first(folder: Path) -> tuple[Path, Outcome, frozenset[Field], float]:
    return folder, *read_by(_diagnose, folder)


def _changed(case: Case) -> tuple[Case, Outcome]:
    value = changed(case.field.value, case.field.about["unit"], case.factor)
    with replaced(case.field.room, **{case.field.name: value}):
        return case, _diagnose(case.folder)


def run(
    folders: Sequence[Path],
    only: Sequence[str] = (),
    jobs: int = 1,
    minutes: float = math.inf,
    diagnose: Diagnose = diagnosed,
    write: Callable[[Runs], None] = lambda _: None,
) -> Runs:
    """All campaigns with every number halved and doubled, in forked workers, as far as the time
    goes; write: is called after each.
    """
    global _diagnose
    _diagnose, runs, end = diagnose, Runs(), time.monotonic() + 60.0 * minutes

    with multiprocessing.get_context("fork").Pool(jobs, maxtasksperchild=1) as pool:
        for folder, outcome, read, seconds in _shown("campaigns", pool.imap, _first, folders):
            runs.before[folder], runs.read[folder] = outcome, read
            runs.seconds[folder] = seconds

        for case, outcome in _shown("numbers", pool.imap, _changed, runs.cases(only)):
            runs.moved[case] = Moved.between(runs.before[case.folder], outcome)
            write(runs)
            if time.monotonic() > end:
                pool.terminate()
                break
    return runs


def _shown(what: str, over: Any, work: Any, items: Sequence[Any]) -> Iterator[Any]:
    with Progress(what, len(items)) as progress:
        for made in over(work, items):
            yield made
            progress.advance()


# --- the page ---

HEAD = """\
# What each tuned number decides

Every tuned number of the diagnosis is halved and doubled, one at a time
(`python -m gritd.tools.dev.sensitivity`). Shares and probabilities are halved and doubled in their
odds, quantiles in the odds of their tail. The columns "verdicts" and "names" count the diagnoses in
which the verdict, or the names that it accepts, are another, and say which campaigns they are of.
Δp is the largest change of an effect's probability. Δtan φ is the largest change of the soil's
tan φ, in its standard deviation. A number that a campaign does not read before its verdict is not
run on it: it can change only what is told of the verdict. The reason of each number, and what it
was learnt from, stand in `tools/diagnose/tuning/`.
"""


def page(runs: Runs, only: Sequence[str] = (), every: int = 0) -> str:
    """The table in Markdown; every: how many campaigns the folder holds."""
    rows = [_row(f, runs) for f in every_field() if any(c.field == f for c in runs.moved)]
    table = [
        "| number | value | runs | verdicts | names | Δp | Δtan φ |",
        "|---|---|--:|---|---|--:|--:|",
    ]
    return "\n".join([HEAD, _extent(runs, only, every), "", *table, *rows, "", _rest(runs), ""])


def _extent(runs: Runs, only: Sequence[str], every: int) -> str:
    """Which campaigns were run, how far, and how long all would take."""
    cases = runs.cases(only)
    lines = []
    for folder in sorted(runs.read, key=lambda f: runs.seconds[f]):
        own = [c for c in cases if c.folder == folder]
        done = sum(c in runs.moved for c in own)
        outcome = runs.before[folder]
        names = ", ".join(outcome.accepted) or "no name"
        lines.append(
            f"- `{folder.name}` ({outcome.verdict}: {names}): {done} of {len(own)} diagnoses,"
            f" {len(runs.read[folder])} numbers read, {runs.seconds[folder]:.0f} s for one"
        )

    done = len(runs.moved)
    kind = "complete" if done == len(cases) else f"partial: {done} of {len(cases)} diagnoses"
    left = sum(runs.seconds[c.folder] for c in cases if c not in runs.moved) / 3600.0
    whole = sum(runs.seconds[c.folder] for c in cases) / 3600.0 / max(len(runs.read), 1)
    times = f"What is left takes about {left:.1f} h of one core."
    if every > len(runs.read):
        times += (
            f" The folder holds {every} campaigns; all of them would take {whole * every:.1f} h or"
            " more, since the cheapest were run."
        )
    return "\n".join([f"This table is {kind}. {times}", "", *lines])


def _row(f: Field, runs: Runs) -> str:
    moved = {case: m for case, m in runs.moved.items() if case.field == f}
    cells = [
        f"`{f}`",
        _number(f.value),
        str(len(moved)),
        _which(c for c, m in moved.items() if m.verdict),
        _which(c for c, m in moved.items() if m.names),
        f"{max(m.probability for m in moved.values()):.2f}",
        f"{max(m.sigmas for m in moved.values()):.2f}",
    ]
    return f"| {' | '.join(cells)} |"


def _which(cases: Iterable[Case]) -> str:
    """How many, and which: `2: nothing ½, ding ×2`."""
    named = [f"{c.folder.name} {'½' if c.factor < 1.0 else '×2'}" for c in cases]
    return f"{len(named)}: {', '.join(named)}" if named else "0"


def _number(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_number(each)}" for name, each in value.items())
    if isinstance(value, tuple):
        return ", ".join(_number(each) for each in value)
    return f"{value:g}"


def _rest(runs: Runs) -> str:
    """Numbers that were not run, and why."""
    read = frozenset().union(*runs.read.values())
    rest = [f for f in every_field() if not any(c.field == f for c in runs.moved)]
    parts: dict[str, list[str]] = {}
    for f in rest:
        parts.setdefault(_why(f, read), []).append(f"`{f}`")
    return "\n\n".join(f"{why}: {', '.join(some)}." for why, some in parts.items())


def _why(f: Field, read: Collection[Field]) -> str:
    if f.about["unit"] in FIXED:
        return "Not a size, not run"
    return "Not run yet" if f in read else "Read by none of these before the verdict, not run"


# --- command ---


def main(argv: Sequence[str]) -> int:
    """Exit 0; 2 for usage."""
    given = _parser().parse_args(argv)
    folders = [f.resolve() for f in sorted(given.campaigns.iterdir()) if f.is_dir()]
    chosen = [f for f in folders if not given.only or f.name in given.only]
    _check(given, {f.name for f in folders})
    out = given.out.resolve()

    def write(runs: Runs) -> None:
        out.write_text(page(runs, given.fields, len(folders)), encoding="utf-8")

    runs = run(chosen, given.fields, given.jobs, given.minutes, write=write)
    print(f"{out}: {len(runs.moved)} diagnoses of {len(runs.cases(given.fields))}")
    return 0


def _check(given: argparse.Namespace, campaigns: set[str]) -> None:
    if missing := {*given.only} - campaigns:
        raise SystemExit(f"{given.campaigns}: found no campaign {', '.join(sorted(missing))}")
    if missing := {*given.fields} - {str(f) for f in every_field()}:
        raise SystemExit(f"--fields: found no number {', '.join(sorted(missing))}")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(description="What halved and doubled numbers change in a diagnosis.")
    parser.add_argument("campaigns", type=Path)
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="campaigns")
    parser.add_argument("--fields", nargs="+", default=[], metavar="ROOM.FIELD", help="numbers")
    parser.add_argument("--jobs", type=int, default=1, help="diagnoses at once")
    parser.add_argument("--minutes", type=float, default=math.inf, help="end after so long")
    parser.add_argument("--out", type=Path, default=Path("docs/sensitivity.md"), metavar="FILE")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
