"""What is decided: a verdict, the explanations that were weighed, and their probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.verdict.nameless import Nameless

Verdict = Literal["consistent", "explained", "unlisted", "insufficient"]


@dataclass(frozen=True)
class Weighed:
    """An explanation and its evidence above the bare model's [nats].

    names:    listed effects; none for the discrepancy of form alone.
    nameless: whether functions without a name act beside them.
    """

    model: Model
    names: tuple[str, ...]
    nameless: bool
    evidence: float
    probability: float = 0.0


@dataclass(frozen=True)
class Decision:
    """best: the model that is accepted, or the bare one; beside: what has no name beside it."""

    verdict: Verdict
    best: Model
    share: float  # of the misfit that the best model's effects take, by squares
    beside: Nameless | None
    probability: dict[str, float]
    unlisted: float
    groups: dict[str, tuple[str, ...]]
    weighed: tuple[Weighed, ...] = ()
