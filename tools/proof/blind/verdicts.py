"""What the diagnosis said of one case, compared with what was true: one row of the score, before
any counting.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.proof.blind import heldout, seal
from gritd.tools.proof.blind.groups import alike
from gritd.tools.proof.blind.plant.concealed import UNLISTED as CONCEALED
from gritd.tools.proof.blind.plant.worlds import HELD
from gritd.tools.proof.blind.strata import LEVELS
from gritd.tools.proof.blind.trial import ALONE, OUTCOME, RESULT, WorkerSpec

NOTHING, UNLISTED, INSUFFICIENT, FAILED = "(nothing)", "(unlisted)", "(insufficient)", "(failed)"
DETECTABLE = 0.9 * LEVELS["weak"]  # times the detection limit
SPOKEN = {"consistent": NOTHING, "unlisted": UNLISTED, "insufficient": INSUFFICIENT}


@dataclass(frozen=True)
class StatedHypothesis:
    """One hypothesis as stated."""

    effect: str
    probability: float
    group: frozenset[str]  # what the diagnosis says it cannot tell from it, itself included
    accepted: bool
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class CaseRow:
    """One case: truth, verdict, and what can be measured of it. NaN where it cannot."""

    number: int
    stratum: str
    level: str
    world: str
    bed: str  # of a pair; empty for a campaign alone
    held: frozenset[str]  # names that are true of the world itself; none for what is new
    truth: tuple[str, ...]
    detectability: float
    limit: float
    inseparable: frozenset[str]  # by the plant: rivals this campaign cannot tell from the truth
    noise_factor: float
    verdict: str
    hypotheses: tuple[StatedHypothesis, ...]
    seconds: float
    note: str
    # c, tan_phi: relative error, and error over sigma, before and after; NaN: said to be unknown
    soil: Mapping[str, Mapping[str, float]]
    parameters: Mapping[str, float]  # where parameterisations coincide: error over stated sigma
    heldout: Mapping[
        str, tuple[float, float, float]
    ]  # channel: before, after, noiseless truth [the channel's unit]
    refit: Mapping[
        str, float
    ]  # channel: variance that an oracle adds which must fit all but the form of the effect
    reference_verdict: str = ""  # what is said of the reference campaign itself
    alone: tuple[CaseRow, ...] = ()  # of two effects: what is said of each alone, in this campaign

    @property
    def pair(self) -> bool:
        return bool(self.bed)

    @property
    def detectable(self) -> bool:
        """Whether one who knows all else would see every effect that is concealed."""
        return bool(self.truth) and self.detectability >= DETECTABLE * self.limit

    @property
    def nameable(self) -> bool:
        """Whether something is there that has a name in the list."""
        return not self.held.union(self.truth) <= set(CONCEALED)

    @property
    def accepted(self) -> tuple[StatedHypothesis, ...]:
        """What it says is there, first names first."""
        if self.verdict != "explained":
            return ()
        return tuple(name for name in self.hypotheses if name.accepted)

    @property
    def alarmed(self) -> bool:
        return self.verdict in ("explained", "unlisted")

    @property
    def first(self) -> StatedHypothesis | None:
        return self.hypotheses[0] if self.verdict == "explained" and self.hypotheses else None

    @property
    def spoken(self) -> str:
        """The name in the confusion matrix."""
        return self.first.effect if self.first else SPOKEN.get(self.verdict, FAILED)

    def right(self, name: str, by: str = "name") -> bool:
        """Whether a name is that of a concealed effect, or of its group by `table`, or in this
        campaign by `plant`.
        """
        true = self.held.union(self.truth)
        if by == "table":
            return any(name in alike(one) for one in true)
        if by == "plant":
            return name in true or name in self.inseparable
        return name in true

    def name_right(self, name: StatedHypothesis, by: str = "name") -> bool:
        """The same of a hypothesis; by `engine`, whether a true one is in its stated group."""
        if by == "engine":
            return bool(name.group & self.held.union(self.truth))
        return self.right(name.effect, by)

    def false_companion(self, by: str = "table") -> bool:
        """Whether a second or third name is accepted that is not there."""
        return any(not self.name_right(name, by) for name in self.accepted[1:])

    def both_named(self, by: str = "name") -> bool:
        """Whether every concealed effect is accepted, by its name or within a group."""
        accepted = self.accepted
        return all(
            any(replace(self, truth=(t,)).name_right(s, by) for s in accepted) for t in self.truth
        )

    def first_right(self, by: str = "name") -> bool:
        return self.first is not None and self.name_right(self.first, by)

    def three_right(self, by: str = "name") -> bool:
        first = self.hypotheses[:3] if self.alarmed else ()
        return any(self.name_right(hypothesis, by) for hypothesis in first)

    def given(self, by: str = "name") -> float:
        """Probability given to the truth."""
        true = [name.probability for name in self.hypotheses if self.name_right(name, by)]
        return max(true, default=0.0) if by == "engine" else min(sum(true), 1.0)

    def excess(self, oracle: str) -> float:
        """Held-out error over an oracle's (`fitted`, `truth`), geometric mean over the channels."""
        ratios = []
        for channel, (_, after, truth) in self.heldout.items():
            best = math.sqrt(
                truth**2 + (self.refit.get(channel, 0.0) if oracle == "fitted" else 0.0)
            )
            if best > 0.0 and after > 0.0:
                ratios.append(after / best)
        return float(np.exp(np.mean(np.log(ratios)))) if ratios else math.nan


def row(spec: WorkerSpec) -> CaseRow:
    """Open the answers, check their seal, and read what was said. Raises CommandError."""
    answers = seal.opened(spec.answers, spec.seal.read_text(encoding="utf-8").strip())
    outcome = json.loads((spec.folder / OUTCOME).read_text(encoding="utf-8"))
    result, trouble = _result(spec.folder / RESULT, outcome)

    of_both = _row(spec, answers, outcome, result, trouble)
    return replace(of_both, alone=tuple(_alone(of_both, folder) for folder in spec.alone))


def _alone(of_both: CaseRow, folder: Path) -> CaseRow:
    """What was said of one of two effects alone, by the number that its folder ends with."""
    result, trouble = _result(folder / RESULT, {"said": "no result"})
    return replace(
        of_both,
        truth=(of_both.truth[int(folder.name.removeprefix(ALONE)) - 1],),
        verdict=str(result.get("verdict", "failed")),
        hypotheses=_hypotheses(result),
        note=trouble or str(result.get("summary", "")),
    )


def _row(
    spec: WorkerSpec,
    answers: Mapping[str, Any],
    outcome: Mapping[str, Any],
    result: Mapping[str, Any],
    trouble: str,
) -> CaseRow:
    return CaseRow(
        number=spec.number,
        stratum=answers["stratum"],
        level=answers["level"],
        world=answers["world"],
        bed=answers["bed"],
        held=frozenset() if answers["bed"] else frozenset(HELD[answers["world"]]),
        truth=tuple(answers["effects"]),
        detectability=min(answers["detectability_single"], default=0.0),
        limit=answers["detection_limit"],
        inseparable=frozenset(answers["inseparable"]),
        noise_factor=answers["noise_factor"],
        verdict=str(result.get("verdict", "failed")),
        hypotheses=_hypotheses(result),
        seconds=float(outcome["seconds"]),
        note=trouble or str(result.get("summary", "")),
        soil=_soil(result, answers),
        parameters=_parameters(result, answers),
        heldout=heldout.errors(result, answers, spec),
        refit=answers["oracle_variance"],
        reference_verdict=str((result.get("reference") or {}).get("verdict", "")),
    )


def _result(path: Path, outcome: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """The diagnosis, or none and why."""
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}, (str(outcome["said"]).strip().splitlines() or ["no result"])[-1]
    return (result, "") if isinstance(result, dict) else ({}, "result is no mapping")


def _hypotheses(result: Mapping[str, Any]) -> tuple[StatedHypothesis, ...]:
    """As listed: what was accepted first, then by probability."""
    hypotheses = [
        StatedHypothesis(
            str(h["effect"]),
            float(h.get("probability") or 0.0),
            frozenset((str(h["effect"]), *h.get("indistinguishable_from", ()))),
            bool(h.get("accepted", False)),
            h.get("parameters") or {},
        )
        for h in result.get("hypotheses", ())
    ]

    return tuple(sorted(hypotheses, key=lambda s: (not s.accepted, -s.probability)))


def _soil(result: Mapping[str, Any], answers: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    stated, errors = result.get("soil") or {}, {}

    for name, true_name in (("c", "cohesion"), ("tan_phi", "tan_phi")):
        true = answers["soil"][true_name]
        before, after = (
            _quantity((stated.get(when) or {}).get(name)) for when in ("before", "after")
        )
        errors[name] = {
            "before": abs(before[0] / true - 1.0),
            "after": abs(after[0] / true - 1.0),
            "z_before": (before[0] - true) / before[1] if before[1] > 0.0 else math.nan,
            "z_after": (after[0] - true) / after[1] if after[1] > 0.0 else math.nan,
        }

    return errors


def _quantity(stated: Any) -> tuple[float, float]:
    if not isinstance(stated, Mapping):
        return math.nan, math.nan
    value, sigma = stated.get("value"), stated.get("sigma")
    return (
        math.nan if value is None else float(value),
        math.nan if sigma is None else float(sigma),
    )


def _parameters(result: Mapping[str, Any], answers: Mapping[str, Any]) -> dict[str, float]:
    """Errors over sigma of parameters that plant and diagnosis state in the same terms, of accepted
    true effects.
    """
    stated = {
        hypothesis.effect: hypothesis.parameters
        for hypothesis in _hypotheses(result)
        if hypothesis.accepted
    }

    errors = {}
    for effect in answers["concealed"]:
        for name, true in effect["coinciding"].items():
            value, sigma = _quantity(stated.get(effect["name"], {}).get(name))
            if sigma > 0.0:
                errors[f"{effect['name']}.{name}"] = (value - true) / sigma
    return errors
