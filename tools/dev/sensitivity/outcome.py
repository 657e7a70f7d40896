"""What counts of a diagnosis, and how far two are apart."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.tools.cli.command import CommandError
from gritd.tools.diagnose.explain.soil import averaged_soil
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.adapter import rig_of
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import read_all
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import search_models
from gritd.tools.diagnose.verdict.decide import decide

Handed = Callable[..., None]  # is given all that a room hands on, before the next one has it
Diagnose = Callable[[Path, Handed], "DiagnosisOutcome"]


@dataclass(frozen=True)
class DiagnosisOutcome:
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
    def between(cls, before: DiagnosisOutcome, after: DiagnosisOutcome) -> Moved:
        """sigmas: change of tan φ in its standard deviation before; 0 without a soil."""
        every = {*before.probabilities, *after.probabilities}
        most = max(
            (abs(before.probabilities.get(n, 0) - after.probabilities.get(n, 0)) for n in every),
            default=0.0,
        )
        apart = abs(after.tan_phi - before.tan_phi) / before.sigma if before.sigma > 0.0 else 0.0
        names = before.accepted != after.accepted
        return cls(before.verdict != after.verdict, names, most, 0.0 if apart != apart else apart)

    @property
    def nothing(self) -> bool:
        """To the last digit."""
        return self == Moved(False, False, 0.0, 0.0)


def diagnosed(folder: Path, handed: Handed = lambda *_: None) -> DiagnosisOutcome:
    """A campaign up to its verdict and soil, with the numbers in force; seed 0. What fails is said
    as a verdict.
    """
    files = sorted(folder.glob("*.mcap"))
    (configuration,) = folder.glob("*.yaml")

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            rig, _ = rig_of(read_all(files), config.load(configuration).settings)
            return decided(rig, handed)
    except (CommandError, ArithmeticError, LookupError, ValueError) as error:
        return DiagnosisOutcome(f"failed: {type(error).__name__}")


def decided(rig: Rig, handed: Handed = lambda *_: None) -> DiagnosisOutcome:
    """The method without what explains a decision: that changes none of what counts here."""
    rng = np.random.default_rng(0)
    handed(rig)

    base = fit_base(rig)
    handed(base, rng)

    screening = prepare_screening(base)
    handed(screening)

    search = search_models(screening)
    handed(search)

    decision = decide(search)
    tan_phi = averaged_soil(search.problem, decision).get("tan_phi")
    return DiagnosisOutcome(
        decision.verdict,
        tuple(sorted(decision.best.names)),
        dict(decision.probability),
        tan_phi.value if tan_phi else math.nan,
        tan_phi.sigma if tan_phi else math.nan,
    )
