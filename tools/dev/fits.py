"""Every fit that decides, against a full bounded optimisation of the same function.

    python -m gritd.tools.dev.fits [CAMPAIGNS …] [--drawn N] [--seed S] [--starts K] [--jobs J]
                                   [--minutes M] [--rows FILE] [--out docs/fits.md]

CAMPAIGNS are folders below which every folder with recordings and one configuration is a campaign,
or with those of a pair in `new` and `reference` (`gritd prove --keep` leaves such). N more are
drawn from our own simulator, each with an effect or none. They come in an order drawn by the seed.
FILE keeps what was compared, a line of JSON for each campaign: a campaign that it holds is not
compared again. Of each search the bare model and the models within reach of the best one decide.
Each is given to scipy's trust region reflective least squares (Branch, Coleman and Li 1999, SIAM
J. Sci. Comput. 21, 1-23) with the same bounds and priors, from where our descent ended and from K
points about it, with the other forms of the effects that the evidence counts. A fit is off by what
the best of these reaches beyond the objective that the evidence counts, which is that where our
descent ended (fit/model.py) [nats].
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cho_solve
from scipy.optimize import least_squares

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import CommandError, Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.progress import Progress
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import EffectsObjective, Problem
from gritd.tools.diagnose.method import accustomed, fit_base
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import search_models
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.blind.handover import NEW, REFERENCE
from gritd.tools.proof.ours.cases import draw, record, scaled

LIMIT = 0.5  # [nats] what a fit may be off by
SPREAD = 0.3  # [prior σ, expected sizes] of the points about our optimum
LARGEST = 1.5  # expected sizes of a drawn effect
FAR = 1e6  # a residual where the model runs away


@dataclass(frozen=True)
class Compared:
    """One fit. nats: its objective where our descent ended, which its evidence counts; gain: what
    the full optimisation gains beyond it, from there and from points about it.
    """

    case: str
    names: tuple[str, ...]
    nats: float
    converged: bool
    gain: float
    gain_elsewhere: float


# ---- one fit -----------------------------------------------------------------------------------


def deciding(search: EffectSearch) -> list[Model]:
    """The models whose evidence can change a verdict: the bare one and those near the best."""
    if len(search.models) < 2:
        return [search.base]
    best = search.weight(search.best())
    near = [m for m in search.models[1:] if search.weight(m) > best - TUNING.search.little]
    return list(dict.fromkeys([search.bare, *near]))


def problem_of(search: EffectSearch, model: Model) -> Problem:
    """The recordings, with what the model's fit was allowed."""
    if model.marginal is None:
        return search.problem
    terms = model.marginal.terms
    sizes = [f.sizes.values[n] for f, n in zip(terms, model.chosen, strict=True)]
    return search.problem.with_terms(terms, sizes)


def optimised(problem: Problem, model: Model, start: Array) -> float:
    """The objective [nats] that scipy reaches from constants and effect parameters (q + p,)."""
    ground = problem.ground(model.fitted.effects, model.fitted.free)
    low, high = ground.bounds.low, ground.bounds.high
    inside = np.clip(start, low + 1e-9 * (high - low), high - 1e-9 * (high - low))

    optimum = least_squares(
        lambda centre: _residuals(ground, problem, centre),
        inside,
        lambda centre: _slopes(ground, problem, centre),
        bounds=(low, high),
        xtol=1e-10,
        ftol=1e-10,
        gtol=1e-10,
        max_nfev=60,
    )
    return float(optimum.cost)


def standing(problem: Problem, model: Model) -> float:
    """The objective [nats] where a model's fit stands, beside the other forms that its evidence
    counts.
    """
    fitted = model.fitted
    return problem.ground(fitted.effects, fitted.free).tried(fitted.centre)[1]


def _residuals(ground: EffectsObjective, problem: Problem, centre: Array) -> Array:
    """All whose squares are the objective: values, what is allowed, and strains."""
    tried, nats = ground.tried(centre)
    weights = ground.penalty[: centre.size]
    if not np.isfinite(nats):
        return np.full(tried.residual.size + tried.slack.size + centre.size, FAR)
    left = tried.residual - problem.nuisance.whitened.times(tried.slack)
    return np.concatenate((left, tried.slack, weights * centre))


def _slopes(ground: EffectsObjective, problem: Problem, centre: Array) -> Array:
    """Their derivatives; what is allowed follows every move, so it is eliminated exactly."""
    own = ground.linearised(ground.tried(centre)[0]).own
    follows = cho_solve((problem.root, True), problem.nuisance.pulled(own), check_finite=False)
    left = own - problem.nuisance.whitened.dense @ follows
    return np.vstack((-left, -follows, np.diag(ground.penalty[: centre.size])))


def compared(
    case: str, search: EffectSearch, starts: int, rng: np.random.Generator
) -> list[Compared]:
    """Every fit of a search that decides, from where it ended and from so many points about it."""
    rows = []

    for model in deciding(search):
        problem, here = problem_of(search, model), model.fitted.centre
        ours = standing(problem, model)
        near = optimised(problem, model, here)
        moved = [here + SPREAD * rng.standard_normal(here.size) for _ in range(starts)]
        elsewhere = min((optimised(problem, model, m) for m in moved), default=near)
        row = (case, model.names, ours, model.fitted.converged, ours - near, ours - elsewhere)
        rows.append(Compared(*row))
    return rows


# ---- campaigns ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class FitCase:
    """A campaign on disk, or one to be drawn from a seed."""

    folder: Path | None
    seed: int
    starts: int

    @property
    def name(self) -> str:
        if self.folder is None:
            return f"drawn {self.seed}"
        return str(self.folder.resolve())


@dataclass(frozen=True)
class FitOutcome:
    """All fits of a campaign; failed: why it could not be diagnosed."""

    name: str
    rows: tuple[Compared, ...]
    failed: str = ""


def campaigns(roots: Sequence[Path]) -> Iterator[Path]:
    """Folders that hold recordings and one configuration."""
    for root in roots:
        if not root.is_dir():
            raise CommandError(f"{root}: no such folder")
        for configuration in sorted(root.rglob("*.yaml")):
            folder = configuration.parent
            if any(folder.glob("*.mcap")) or _is_pair(folder):
                yield folder


def _is_pair(folder: Path) -> bool:
    return all(any((folder / part).glob("*.mcap")) for part in (NEW, REFERENCE))


def run_case(case: FitCase) -> FitOutcome:
    """One campaign; one that cannot be diagnosed compares nothing."""
    rng = np.random.default_rng(case.seed)
    name = "/".join(Path(case.name).parts[-4:]) if case.folder else case.name

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            rig = _recorded(case.folder) if case.folder else _drawn(rng)
            rig, _ = accustomed(rig)
            search = search_models(prepare_screening(fit_base(rig)))
            return FitOutcome(case.name, tuple(compared(name, search, case.starts, rng)))
        except CommandError as error:
            return FitOutcome(case.name, (), str(error))


def _recorded(folder: Path) -> Rig:
    (configuration,) = folder.glob("*.yaml")
    settings = config.load(configuration).settings
    if _is_pair(folder):
        new, before = (
            read_all(sorted((folder / part).glob("*.mcap"))) for part in (NEW, REFERENCE)
        )
        return rig_of(new, settings, before)[0]
    return rig_of(read_all(sorted(folder.glob("*.mcap"))), settings)[0]


def _drawn(rng: np.random.Generator) -> Rig:
    """One effect of the library in two cases of three, none in the third."""
    plan = draw(config.load(packaged()).settings, rng)
    name = str(rng.choice(sorted(EFFECTS)))
    acting = [scaled(EFFECTS[name], LARGEST, rng)] if rng.random() < 2.0 / 3.0 else []
    return wheel_rig(record(plan, acting), plan.settings)


# ---- the page ----------------------------------------------------------------------------------


def page(outcomes: Sequence[FitOutcome], asked: int) -> str:
    """The result in Markdown."""
    rows = [row for outcome in outcomes for row in outcome.rows]
    off = [r for r in rows if _off(r) > LIMIT]
    near = [r for r in rows if abs(r.gain) > LIMIT]
    done = [outcome for outcome in outcomes if not outcome.failed]

    lines = [
        "# Fits that decide, against a full bounded optimisation",
        "",
        "Made by `python -m gritd.tools.dev.fits`; its first lines say how.",
        "",
        f"{len(done)} of {asked} campaigns, {len(rows)} fits that decide:",
        "",
        f"- off by more than {LIMIT} nats from where the descent ended: {len(near)};",
        f"- off by more than {LIMIT} nats from there or from a point about it: {len(off)};",
        f"- did not converge, and are reported so: {sum(not r.converged for r in rows)};",
        f"- campaigns that could not be diagnosed: {len(outcomes) - len(done)}.",
    ]

    if off:
        lines += ["", "| campaign | model | converged | gained there | elsewhere |"]
        lines += ["|---|---|---|--:|--:|"]
        lines += [
            f"| {r.case} | {', '.join(r.names) or 'bare'} | {'yes' if r.converged else 'no'}"
            f" | {r.gain:.2f} | {r.gain_elsewhere:.2f} |"
            for r in sorted(off, key=_off, reverse=True)
        ]
    return "\n".join([*lines, ""])


def _off(row: Compared) -> float:
    """By what a fit is off [nats], to either side."""
    return max(abs(row.gain), row.gain_elsewhere)


def kept(file: Path) -> list[FitOutcome]:
    """What a file of JSON lines holds."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return [_outcome(json.loads(line)) for line in lines]


def _outcome(line: dict[str, Any]) -> FitOutcome:
    rows = (Compared(**{**row, "names": tuple(row["names"])}) for row in line["rows"])
    return FitOutcome(line["name"], tuple(rows), line["failed"])


def main(argv: Sequence[str] | None = None) -> int:
    """The command."""
    arguments = _parser().parse_args(argv)
    cases = _cases(arguments)
    asked = {case.name for case in cases}
    outcomes = [o for o in kept(arguments.rows) if o.name in asked] if arguments.rows else []
    held = {outcome.name for outcome in outcomes}
    left = [case for case in cases if case.name not in held]

    end = time.monotonic() + 60.0 * arguments.minutes
    with (
        multiprocessing.get_context("fork").Pool(arguments.jobs, maxtasksperchild=1) as pool,
        Progress("campaigns", len(left)) as progress,
    ):
        for outcome in pool.imap_unordered(run_case, left):
            outcomes.append(outcome)
            progress.advance()
            _keep(arguments.rows, outcome)
            if arguments.out:
                arguments.out.write_text(page(outcomes, len(cases)), encoding="utf-8")
            if time.monotonic() > end:
                pool.terminate()
                break
    print(page(outcomes, len(cases)))
    return 0


def _cases(arguments: argparse.Namespace) -> list[FitCase]:
    """All that is asked for, in an order drawn by the seed."""
    seed, starts = arguments.seed, arguments.starts
    cases = [FitCase(folder, seed, starts) for folder in campaigns(arguments.campaigns)]
    cases += [FitCase(None, seed + 1 + k, starts) for k in range(arguments.drawn)]
    if not cases:
        raise CommandError("nothing to compare: name campaigns, or --drawn N")
    return [cases[k] for k in np.random.default_rng(seed).permutation(len(cases))]


def _keep(file: Path | None, outcome: FitOutcome) -> None:
    if file:
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(asdict(outcome)) + "\n")


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m gritd.tools.dev.fits", description=__doc__)
    parser.add_argument("campaigns", nargs="*", type=Path)
    parser.add_argument("--drawn", type=int, default=0, help="campaigns of our own simulator")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--starts", type=int, default=1, help="points about each optimum")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--rows", type=Path, metavar="FILE", help="keeps what was compared")
    parser.add_argument("--out", type=Path)
    return parser


if __name__ == "__main__":
    sys.exit(guarded(main))
