"""Which campaigns of a batch alarm, without the search that follows: seconds a campaign.

    gritd prove --strata none,awkward --seal-only --keep --output BATCH …
    python -m gritd.tools.dev.alarms BATCH… [--level 'correlated 0.95'] [--jobs J]

A line a case: what was concealed, the largest surprise beside its threshold, the evidence that is
left with the noise's colour open. Then how many of each level alarm.
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.tools.cli.command import Parser
from gritd.tools.diagnose.method import accustomed, fit_base
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.diagnose.screen.screen import Screen
from gritd.tools.diagnose.screen.screening import prepare_screening, screen_of_base
from gritd.tools.proof.blind.handover import CONFIGURATION, NEW, REFERENCE
from gritd.tools.proof.blind.trial import GIVEN


@dataclass(frozen=True)
class Told:
    """Of one case: what it conceals, and whether it alarms."""

    name: str
    kind: str  # its stratum and level
    effects: tuple[str, ...]
    screen: Screen

    def line(self) -> str:
        of, surprise = self.screen.largest
        word = "alarm" if self.screen.alarmed else "quiet"
        shape = of if isinstance(of, str) else f"{of.channel} along {', '.join(of.along)}"
        numbers = f"{surprise:.1f} of {self.screen.threshold:.1f}, open {self.screen.open:.1f}"
        concealed = ", ".join(self.effects) or "nothing"
        return f"{self.name} {self.kind} ({concealed}): {word}, {shape} {numbers}"


def main(argv: Sequence[str] | None = None) -> None:
    given = _parser().parse_args(argv)
    every = [case for batch in given.batches for case in _cases(batch, given.level)]
    alarms: Counter[str] = Counter()
    total: Counter[str] = Counter()
    with ProcessPoolExecutor(given.jobs) as pool:
        for told in pool.map(_told, every):
            print(told.line(), flush=True)
            total[told.kind] += 1
            alarms[told.kind] += told.screen.alarmed

    for kind, count in sorted(total.items()):
        print(f"{kind}: {alarms[kind]} of {count} alarm")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="alarms", description="Which campaigns of a batch alarm.")
    parser.add_argument("batches", nargs="+", type=Path, metavar="BATCH")
    parser.add_argument("--level", help="of these cases alone, as their answers name it")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    return parser


def _cases(batch: Path, level: str | None) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Folder of what was handed over, and answers, of every case whose recordings are kept."""
    for path in sorted((batch / "answers").glob("case-*.json")):
        answers: Any = json.loads(path.read_text(encoding="utf-8"))["answers"]
        folder = batch / "cases" / path.stem / GIVEN
        if level in (None, answers["level"]) and any(folder.rglob("*.mcap")):
            yield folder, answers


def _told(case: tuple[Path, dict[str, Any]]) -> Told:
    folder, answers = case
    kind = " ".join(part for part in (answers["stratum"], answers["level"]) if part)
    name = folder.parent.name
    return Told(name, kind, tuple(answers["effects"]), screen_of(folder, answers["bed"]))


def screen_of(folder: Path, bed: str = "") -> Screen:
    """The first screen of the recordings of a case; bed: of a pair, whether it is the same."""
    settings = config.load(folder / CONFIGURATION).settings
    if bed:
        new, before = (read_all(sorted((folder / d).glob("*.mcap"))) for d in (NEW, REFERENCE))
        rig, _ = rig_of(new, settings, before, "same" if bed == "same" else "prepared")
    else:
        rig, _ = rig_of(read_all(sorted(folder.glob("*.mcap"))), settings)

    rng = np.random.default_rng(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        rig, _ = accustomed(rig)
        return screen_of_base(prepare_screening(fit_base(rig, rng), rng))


if __name__ == "__main__":
    main()
