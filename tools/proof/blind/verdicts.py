"""What the diagnosis said of one case, beside what was true: one row of the score, before any
counting.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.proof.blind import seal
from gritd.tools.proof.blind.groups import alike
from gritd.tools.proof.blind.trial import OUTCOME, Spec

NOTHING, UNLISTED, INSUFFICIENT, FAILED = "(nothing)", "(unlisted)", "(insufficient)", "(failed)"
SPOKEN = {"consistent": NOTHING, "unlisted": UNLISTED, "insufficient": INSUFFICIENT}


@dataclass(frozen=True)
class Said:
    """One hypothesis as stated."""

    effect: str
    probability: float
    group: frozenset[str]  # what the diagnosis says it cannot tell from it, itself included
    accepted: bool
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class Row:
    """One case: truth, verdict, and what can be measured of it. NaN where it cannot."""

    number: int
    stratum: str
    level: str
    truth: tuple[str, ...]
    detectability: float
    limit: float
    inseparable: frozenset[str]  # by the plant: rivals this campaign cannot tell from the truth
    noise_factor: float
    verdict: str
    hypotheses: tuple[Said, ...]
    seconds: float
    note: str
    soil: Mapping[str, Mapping[str, float]]  # c, tan_phi: relative error before and after, z after
    parameters: Mapping[str, float]  # where parameterisations coincide: error over stated sigma
    heldout: Mapping[
        str, tuple[float, float, float]
    ]  # channel: before, after, noiseless truth [the channel's unit]
    refit: Mapping[
        str, float
    ]  # channel: variance that an oracle adds which must fit all but the form of the effect

    @property
    def alarmed(self) -> bool:
        return self.verdict in ("explained", "unlisted")

    @property
    def first(self) -> Said | None:
        return self.hypotheses[0] if self.verdict == "explained" and self.hypotheses else None

    @property
    def spoken(self) -> str:
        """The name in the confusion matrix."""
        return self.first.effect if self.first else SPOKEN.get(self.verdict, FAILED)

    def right(self, name: str, by: str = "name") -> bool:
        """Whether a name is that of a concealed effect, or of its group by `table`, or in this
        campaign by `plant`.
        """
        if by == "table":
            return any(name in alike(true) for true in self.truth)
        if by == "plant":
            return name in self.truth or name in self.inseparable
        return name in self.truth

    def first_right(self, by: str = "name") -> bool:
        if self.first is None:
            return False
        if by == "engine":
            return bool(self.first.group & set(self.truth))
        return self.right(self.first.effect, by)

    def three_right(self, by: str = "name") -> bool:
        first = self.hypotheses[:3] if self.alarmed else ()
        if by == "engine":
            return any(said.group & set(self.truth) for said in first)
        return any(self.right(said.effect, by) for said in first)

    def given(self, by: str = "name") -> float:
        """Probability given to the truth."""
        if by == "engine":
            return max(
                (s.probability for s in self.hypotheses if s.group & set(self.truth)), default=0.0
            )
        return min(
            sum(said.probability for said in self.hypotheses if self.right(said.effect, by)), 1.0
        )

    def excess(self, oracle: str) -> float:
        """Held-out error over the oracle's (`fitted` or `truth`), geometric mean over channels."""
        ratios = []
        for channel, (_, after, truth) in self.heldout.items():
            best = math.sqrt(
                truth**2 + (self.refit.get(channel, 0.0) if oracle == "fitted" else 0.0)
            )
            if best > 0.0 and after > 0.0:
                ratios.append(after / best)
        return float(np.exp(np.mean(np.log(ratios)))) if ratios else math.nan


def row(spec: Spec) -> Row:
    """Open the answers, check their seal, and read the diagnosis. Raises CommandError."""
    answers = seal.opened(spec.answers, spec.seal.read_text(encoding="utf-8").strip())
    outcome = json.loads((spec.folder / OUTCOME).read_text(encoding="utf-8"))
    result, trouble = _result(spec.folder / "result.json", outcome)

    return Row(
        number=spec.number,
        stratum=answers["stratum"],
        level=answers["level"],
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
        heldout=_heldout(result, answers, spec),
        refit=answers["oracle_variance"],
    )


def _result(path: Path, outcome: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """The diagnosis, or none and why."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}, (str(outcome["said"]).strip().splitlines() or ["no result"])[-1]
    return (found, "") if isinstance(found, dict) else ({}, "result is no mapping")


def _hypotheses(result: Mapping[str, Any]) -> tuple[Said, ...]:
    """As listed: what was accepted first, then by probability."""
    said = [
        Said(
            str(h["effect"]),
            float(h.get("probability") or 0.0),
            frozenset((str(h["effect"]), *h.get("indistinguishable_from", ()))),
            bool(h.get("accepted", False)),
            h.get("parameters") or {},
        )
        for h in result.get("hypotheses", ())
    ]
    return tuple(sorted(said, key=lambda s: (not s.accepted, -s.probability)))


def _soil(result: Mapping[str, Any], answers: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    stated, found = result.get("soil") or {}, {}

    for name, true_name in (("c", "cohesion"), ("tan_phi", "tan_phi")):
        true = answers["soil"][true_name]
        before, after = (
            _quantity((stated.get(when) or {}).get(name)) for when in ("before", "after")
        )
        found[name] = {
            "before": abs(before[0] / true - 1.0),
            "after": abs(after[0] / true - 1.0),
            "z_before": (before[0] - true) / before[1] if before[1] > 0.0 else math.nan,
            "z_after": (after[0] - true) / after[1] if after[1] > 0.0 else math.nan,
        }

    return found


def _quantity(said: Any) -> tuple[float, float]:
    if not isinstance(said, Mapping):
        return math.nan, math.nan
    value, sigma = said.get("value"), said.get("sigma")
    return (
        math.nan if value is None else float(value),
        math.nan if sigma is None else float(sigma),
    )


def _parameters(result: Mapping[str, Any], answers: Mapping[str, Any]) -> dict[str, float]:
    """Errors over sigma of parameters that plant and diagnosis state in the same terms, of accepted
    true effects.
    """
    stated = {said.effect: said.parameters for said in _hypotheses(result) if said.accepted}
    found = {}
    for effect in answers["concealed"]:
        for name, true in effect["coinciding"].items():
            value, sigma = _quantity(stated.get(effect["name"], {}).get(name))
            if sigma > 0.0:
                found[f"{effect['name']}.{name}"] = (value - true) / sigma
    return found


# --- held-out error against the oracle ---


def _heldout(
    result: Mapping[str, Any], answers: Mapping[str, Any], spec: Spec
) -> dict[str, tuple[float, float, float]]:
    """Root mean square errors on the diagnosis' own held-out samples, beside those of the noiseless
    truth on them.
    """
    sums: dict[str, list[np.ndarray[Any, Any]]] = {}
    begins = {f"run-{number}": run["begins"] for number, run in enumerate(answers["runs"], start=1)}

    for trace in result.get("traces") or ():
        path = spec.answers.with_name(f"{spec.name}.{trace['run']}.npz")
        if path.exists():
            with np.load(path) as truth:
                if trace["channel"] in truth:
                    errors = _errors(
                        trace, begins[trace["run"]] + truth["time"], truth[trace["channel"]]
                    )
                    sums.setdefault(trace["channel"], []).append(errors)

    return {channel: _roots(np.concatenate(parts, axis=1)) for channel, parts in sums.items()}


def _errors(trace: Mapping[str, Any], time: Any, truth: Any) -> np.ndarray[Any, Any]:
    """Squared errors (3, n) of before, after and oracle, where the diagnosis used the sample."""
    at, measured, before, after, used = (
        np.array([math.nan if value is None else value for value in trace[name]], dtype=float)
        for name in ("time", "measured", "before", "after", "used")
    )
    squares = (measured - np.stack((before, after, np.interp(at, time, truth)))) ** 2
    kept: np.ndarray[Any, Any] = squares[:, (used > 0.5) & np.isfinite(squares).all(axis=0)]
    return kept


def _roots(squares: np.ndarray[Any, Any]) -> tuple[float, float, float]:
    if not squares.shape[1]:
        return math.nan, math.nan, math.nan
    before, after, oracle = np.sqrt(squares.mean(axis=1)).tolist()
    return before, after, oracle
