"""What is decided: a verdict, the explanations that were weighed, and their probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Literal

from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.verdict.unexplained import UnexplainedTerms

Verdict = Literal["consistent", "explained", "unlisted", "insufficient"]
QUIET = ("consistent", "insufficient")  # verdicts by which no mismatch shows


@dataclass(frozen=True)
class WeighedExplanation:
    """An explanation and its evidence above the bare model's [nats].

    names:    listed effects; none for the discrepancy of form alone.
    functions: how many unexplained terms act beside them.
    common:   how many of the effects act in the channels where others act, but one.
    share:    of the misfit that the effects take.
    trust:    of each effect, the probability that it is there and nothing that resembles it, if
        this explanation is the best.
    fitting:  how likely it is that its effects, or what resembles them, are seen so: 1 for effects
        that are there and take all of the misfit.
    """

    model: Model
    names: tuple[str, ...]
    functions: int
    evidence: float
    probability: float = 0.0
    common: float = 0.0
    share: float = 0.0
    trust: tuple[float, ...] = ()
    fitting: float = 1.0

    @property
    def nameless(self) -> bool:
        """Whether unexplained terms act beside the effects."""
        return self.functions > 0

    @property
    def trusts(self) -> dict[str, float]:
        """Of each effect by name, wholly if nothing was said."""
        return dict(zip(self.names, self.trust or (1.0 for _ in self.names), strict=True))

    @property
    def listed(self) -> float:
        """Probability that some of its effects are there, if it is the best."""
        return 1.0 - prod(1.0 - trust for trust in self.trusts.values())


@dataclass(frozen=True)
class Resembled:
    """An effect of the likeliest explanation that is not accepted; model: that explanation; share:
    of the misfit that it takes; predicts: whether runs that were held out are predicted better with
    it, where that is what it was judged by.
    """

    name: str
    share: float
    model: Model
    predicts: bool = True

    @property
    def forms(self) -> float:
        """The share by which our form of the effect must be bent."""
        return self.model.form_share(self.name)


@dataclass(frozen=True)
class Decision:
    """best: the model that is accepted, or the bare one; beside: what has no name beside it;
    unlisted: probability that nothing of the list is there; resembled: what the likeliest
    explanation has beside what is accepted.
    """

    verdict: Verdict
    best: Model
    share: float  # of the misfit that the best model's effects take, by squares
    beside: UnexplainedTerms | None
    probability: dict[str, float]
    unlisted: float
    groups: dict[str, tuple[str, ...]]
    weighed: tuple[WeighedExplanation, ...] = ()
    resembled: tuple[Resembled, ...] = ()
