"""A set of effects and its fit."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.fit.problem import Fitted


@dataclass(frozen=True, eq=False)
class Model:
    """The base model with some effects, fitted together with the constants."""

    fitted: Fitted
    names: tuple[str, ...] = ()  # of the effects
    log_prior: float = 0.0  # of so many effects at work [nats]

    @property
    def evidence(self) -> float:
        return self.fitted.log_evidence + self.log_prior
