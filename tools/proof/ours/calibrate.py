"""`python -m gritd.tools.proof.ours.calibrate --out OUT PATH…`: learn how far evidence is to be
trusted.

Each PATH is the folder of an opened batch of blind trials (`gritd prove --output PATH`). The
temperature and the odds are those that give the truth of every case the largest probability, on
average: the logarithmic score, which only stated probabilities that are true maximise (Good 1952).
A prior (START, PRIOR) keeps what few cases do not tell. The truth of a case is any set of effects
that holds a true one, weighted by how many of its effects are true; of one outside the list, or of
a pair in which nothing is new, an explanation without names.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logsumexp

from gritd.estimator.effects import EFFECTS
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import CommandError
from gritd.tools.cli.guard import guarded
from gritd.tools.diagnose.search.calibration import OddsCalibration
from gritd.tools.proof.blind.groups import alike
from gritd.tools.proof.blind.plant.worlds import HELD, PAPER

# ln temperature; log odds: listed, more, nameless; logit of the lapse
START = np.array([np.log(3.0), 1.1, -1.9, 0.0, -3.5])
PRIOR = 1.0  # standard deviation of each about START
OTHERS = 30  # names among which a lapse spreads


@dataclass(frozen=True)
class WeighedCase:
    """The explanations of one case, and how much of each is true (k,)."""

    evidence: Array  # [nats]
    count: Array  # listed effects
    nameless: Array  # 1 where unexplained terms act too
    right: Array
    candidates: int


def case_of(
    weighed: Sequence[dict[str, Any]],
    truth: Sequence[str],
    unlisted: bool,
    candidates: int,
    held: Collection[str] = (),
) -> WeighedCase:
    """From the explanations of a diagnosis and the effects that were at work; held: names that are
    true of the rig itself, which are neither asked for nor wrong.
    """
    right = [_true(w["names"], [] if unlisted else truth, held) for w in weighed]

    return WeighedCase(
        np.array([w["evidence"] for w in weighed]),
        np.array([len(w["names"]) for w in weighed]),
        np.array([float(w["nameless"]) for w in weighed]),
        np.array(right),
        candidates,
    )


def _true(names: Sequence[str], truth: Sequence[str], held: Collection[str]) -> float:
    """How much of a set of effects is right: what both share over all that either holds. Effects
    that say the same in most campaigns count as one.
    """
    asked = {alike(name) for name in truth}
    own = {alike(name) for name in held}
    named = {alike(name) for name in names}
    named = {group for group in named if group in asked or group not in own}
    if not named or not asked:
        return float(not named and not asked)
    return len(named & asked) / len(named | asked)


def log_truth(case: WeighedCase, by: OddsCalibration) -> float:
    """Log probability of the truth of a case."""
    weight = replace(by, candidates=case.candidates).weights(
        case.evidence, case.count, case.nameless
    )
    given_truth = float(np.sum(np.exp(weight - logsumexp(weight)) * case.right))
    return float(np.log(by.lapse / OTHERS + (1.0 - by.lapse) * given_truth))


def calibration(x: Array) -> OddsCalibration:
    """From the unknowns of the search (5,)."""
    temperature, listed, more, nameless, lapse = x.tolist()
    return OddsCalibration(float(np.exp(temperature)), listed, more, nameless, float(expit(lapse)))


def learn(cases: Sequence[WeighedCase]) -> tuple[OddsCalibration, float]:
    """The calibration, and its mean log score over the cases [nats]."""

    def loss(x: Array) -> float:
        strain = 0.5 * np.sum(((x - START) / PRIOR) ** 2)
        return float(strain - sum(log_truth(case, calibration(x)) for case in cases))

    by = calibration(minimize(loss, START, method="L-BFGS-B").x)
    return by, float(np.mean([log_truth(case, by) for case in cases]))


# ---- where cases come from ---------------------------------------------------------------------


def read(folder: Path) -> list[WeighedCase]:
    """The cases of an opened batch that alarmed: the others say nothing of names. A campaign alone
    counts where it alarmed rightly.
    """
    cases = []
    for result in sorted(folder.glob("cases/*/result.json")):
        sealed = folder / "answers" / f"{result.parent.name}.json"
        answers = json.loads(sealed.read_text(encoding="utf-8"))["answers"]
        diagnosis = json.loads(result.read_text(encoding="utf-8"))
        pair = bool(answers.get("bed"))
        if diagnosis["explanations"] and (pair or answers["effects"]):
            unlisted = not set(answers["effects"]) & EFFECTS.keys()
            held = () if pair else HELD[answers.get("world", PAPER)]
            count = diagnosis["candidates"]
            cases.append(
                case_of(diagnosis["explanations"], answers["effects"], unlisted, count, held)
            )

    return cases


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m gritd.tools.proof.ours.calibrate", description=__doc__
    )
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--note", default="", help="how the cases were made; kept with the table")
    arguments = parser.parse_args(argv)

    cases = [case for path in arguments.paths for case in read(path)]
    if not cases:
        where = ", ".join(map(str, arguments.paths))
        raise CommandError(f"{where}: found no trial that raised an alarm; expected some")
    by, mean_log_truth = learn(cases)
    table = {name: value for name, value in asdict(by).items() if name != "candidates"}
    table |= {"cases": len(cases), "score": mean_log_truth, "note": arguments.note}
    print(json.dumps(table, indent=1))
    if arguments.out is not None:
        arguments.out.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
