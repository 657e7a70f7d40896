"""Tuned numbers of the filter: each with its reason and what it was learnt from.

What follows when one is halved or doubled stands in docs/filter.md, measured by
`python -m gritd.tools.dev.soil_changes --number NAME=VALUE`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True)
class ChangeTuning:
    """When the soil is said to have changed, and how it is learnt anew."""

    # [nats] of evidence for a change. A false alarm comes at most every e^11.2 stretches of half a
    # second (Ville), 10 h; the inequality is exact for the noise that is stated.
    alarm: float = 11.2

    # [prior σ/√s] random walk of the soil right after a change: a ramp goes on changing. Learnt
    # from ramps of 20 s.
    walk: float = 0.1

    # [s] in which that walk dies down. Learnt from ramps of 20 s.
    cooling: float = 10.0

    # [s] for which a tick says that the soil changed: what the filter needs to see it at another
    # slip. Judgement.
    settled: float = 5.0


@dataclass(frozen=True)
class TrustTuning:
    """When model and measurement disagree, and when the estimate is not to be believed."""

    # [s] over which normalised innovations are averaged. Judgement: a few slips of the wheel.
    memory: float = 2.0

    # Windows over which they are at least: two stretches, for a change of the soil is judged where
    # a stretch ends.
    windows: int = 10

    # Mean square beyond which model and measurement disagree. A calibration three σ off keeps all
    # innovations on one side, and is no disagreement: 3² of its own.
    mismatch: float = 9.0

    # Mean square beyond which σ is set back to the prior's.
    inconsistent: float = 12.0

    # Most that one window counts: a spike of any size resets nothing.
    most: float = 25.0

    # [s] before σ is set back once more: what it takes to learn anew.
    patience: float = 5.0

    # [s] in which a reset after a reset says that the prior is too sure.
    relapse: float = 20.0

    # Factor on the prior's σ with every reset in a row, and how often at most: a truth ten σ off
    # the prior lies within the second.
    doubt: float = 4.0
    widest: int = 3

    # Resets in a row after which the estimate is not believed.
    diverged: int = 3

    # Posterior over prior σ beyond which the estimate says less than the prior does.
    wider: float = 1.5

    # Changes of the soil within the memory of them beyond which they explain nothing any more. A
    # ramp of 20 s is reported as a few steps, four at most.
    restless: float = 4.0

    # [s] in which a change is forgotten.
    restless_memory: float = 60.0

    # [s] at a bound before it is said.
    at_bound: float = 1.0

    # [prior σ] from the prior's mean beyond which a bound is no answer.
    improbable: float = 2.0


@dataclass(frozen=True)
class FormTuning:
    """How the learnt discrepancy of form enters the update."""

    # [s] of driving over which the rest of δ stays the same. It is the same at the same conditions,
    # so it does not average out while they last; the longest stretches of a schedule are this long.
    lasting: float = 10.0

    # Sizes of the error of form of which nothing was learnt, in shares of the load: what integrals
    # and tables miss; what sensors and their filters do; what a good model misses; what a wrong one
    # does. A factor of seven between them: with five conditions a record tells such sizes apart.
    # Judgement.
    sizes: tuple[float, ...] = (0.0001, 0.0007, 0.005, 0.035)

    # So many of them, the smallest, are no miss of the equations.
    holding: int = 2

    @property
    def own(self) -> tuple[float, ...]:
        """For each size the error that a stretch has of its own, in addition to the smooth one: as
        large, and no larger than what sensors and their filters do.
        """
        return tuple([min(size, self.sizes[self.holding - 1]) for size in self.sizes])

    @property
    def usual(self) -> float:
        """That error where the equations hold: halfway, by ratio, between the sizes that say so. A
        change of the soil is judged together with it. Judgement: with the smaller the simulated
        testbed shows no flag in 2 h of unchanged soil either, but sensors of other rigs add errors.
        """
        return sqrt(self.own[0] * self.own[self.holding - 1])

    # Their probabilities before the run. Judgement: half of the rigs obey their equations.
    odds: tuple[float, ...] = (0.25, 0.25, 0.25, 0.25)

    # Probability of a larger size than these beyond which the estimate is not believed.
    misfit: float = 0.99


CHANGE = ChangeTuning()
FORM = FormTuning()
TRUST = TrustTuning()
