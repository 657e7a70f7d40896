"""The on-line filter on rigs that do not obey the equations, with and without what a reference
campaign taught of them.

    python -m gritd.tools.dev.learnt_form [--world NAME] [--seeds N] [--first SEED] [--out FILE]

For every seed the plant of `gritd prove` draws a rig, a soil and a pair of campaigns in a world
whose physics is not the paper's, nothing new in the second one, the bed left as it was. The first
is diagnosed, and applied. The second is diagnosed with what was applied: nothing is new in it, so
`consistent` is right. The filter goes over the second, from run to run, three times: with the
stated configuration; with what was applied but its discrepancy, so with effects and soil alone; and
with all of it.
A line a seed says how far c and tan φ lie from the truth at the end, in σ.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Repeatability, Settings, settings_of_run
from gritd.estimator.filter.estimate import KPA, Estimate
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.offline.bed_runs import bed_runs
from gritd.tools.cli.command import Parser
from gritd.tools.diagnose.explain.apply import rewritten
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.proof.blind import cases, handover
from gritd.tools.proof.blind.plant.worlds import FOREIGN
from gritd.tools.proof.blind.strata import Assignment

NAMES = ("c", "tan_phi")
KINDS = ("stated", "without δ", "with δ")


def main(argv: Sequence[str] | None = None) -> None:
    arguments = _parser().parse_args(argv)
    told = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        one = trial(seed, arguments.world)
        told.append(one)
        print(_line(one), flush=True)
        if arguments.out is not None:
            arguments.out.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    for line in summary(told):
        print(line)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="learnt_form", description="On-line c and tan φ with and without the learnt δ."
    )
    parser.add_argument("--world", choices=FOREIGN, default="relaxation")
    parser.add_argument("--seeds", type=int, default=10, help="how many")
    parser.add_argument("--first", type=int, default=1, help="the first of them")
    parser.add_argument("--out", type=Path, help="everything, as JSON")
    return parser


def trial(seed: int, world: str) -> dict[str, Any]:
    """One rig: of each way of filtering, how far the estimate at the end lies from the truth."""
    assignment = Assignment(
        "none", world=world, bed="same", without=(("runs", 3), ("loads", 3), ("wrench", True))
    )
    case = cases.drawn(seed, seed, assignment)

    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "given"
        handover.write(case, handover.driven(case), given)
        stated = config.load(given / handover.CONFIGURATION)
        first = _diagnosed(stated.settings, _files(given / handover.REFERENCE), seed)
        whole = config.loads(rewritten(stated.text, stated, first), "applied")
        ground = case.trial.world.ground
        truth = {"c": float(ground.cohesion), "tan_phi": float(ground.tan_phi)}
        ways = (stated.settings, replace(whole.settings, discrepancy=None), whole.settings)
        files = _files(given / handover.NEW)
        then = _diagnosed(whole.settings, files, seed)
        ends = {name: _end(way, files) for name, way in zip(KINDS, ways, strict=True)}
        began = Tracker(whole.settings, "plain").prior

    return {
        "seed": seed,
        "world": world,
        "verdict": first.verdict,
        "names": [h.effect for h in first.accepted],
        "then": {"verdict": then.verdict, "names": [h.effect for h in then.accepted]},
        "truth": truth,
        "applied": _beside(began, truth),
        "ends": {name: _beside(end, truth) for name, end in ends.items()},
    }


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.mcap"))


def _diagnosed(settings: Settings, files: Sequence[Path], seed: int) -> Diagnosis:
    rig, _ = rig_of(read_all(files), settings)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return diagnose(rig, seed)


def _end(settings: Settings, files: Sequence[Path]) -> Estimate:
    """What the filter knows after the runs, one after the other."""
    runs = [(settings_of_run(settings, r.run), r) for r in read_all(files)]
    return list(bed_runs(runs, Repeatability()))[-1].known.estimate


def _beside(end: Estimate, truth: Mapping[str, float]) -> dict[str, Any]:
    """Values, σ, and errors over σ."""
    values = (end.x[0] * KPA, end.x[1])
    sigmas = (end.P[0][0] ** 0.5 * KPA, end.P[1][1] ** 0.5)
    return {
        name: {"value": value, "sigma": sigma, "off": (value - truth[name]) / sigma}
        for name, value, sigma in zip(NAMES, values, sigmas, strict=True)
    }


def _line(one: Mapping[str, Any]) -> str:
    every = {"applied": one["applied"], **one["ends"]}
    parts = [
        f"{kind}: c {end['c']['off']:+.1f}, tan φ {end['tan_phi']['off']:+.1f} σ"
        for kind, end in every.items()
    ]
    verdicts = " then ".join(
        f"{told['verdict']} ({', '.join(told['names']) or 'no name'})"
        for told in (one, one["then"])
    )
    return f"{one['world']} {one['seed']} {verdicts}; {'; '.join(parts)}"


def summary(told: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """How often the second campaign is consistent; of each way: how often within 2σ, rms of the
    errors over σ, and the median σ over truth.
    """
    quiet = [one["then"]["verdict"] for one in told].count("consistent")
    yield f"second campaign, nothing new, consistent: {quiet} of {len(told)}"

    for kind in KINDS:
        words = []
        for name in NAMES:
            off = np.array([one["ends"][kind][name]["off"] for one in told])
            relative = [one["ends"][kind][name]["sigma"] / one["truth"][name] for one in told]
            words.append(
                f"{name} within 2σ in {np.mean(np.abs(off) <= 2.0):.0%},"
                f" rms {np.sqrt(np.mean(off**2)):.2f} σ, σ {np.median(relative):.1%}"
            )
        yield f"{kind}: {'; '.join(words)}"


if __name__ == "__main__":
    main()
