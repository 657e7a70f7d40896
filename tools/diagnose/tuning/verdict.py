"""Tuned numbers of tools/diagnose/verdict: what is said of the models that were fitted."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned


@dataclass(frozen=True)
class Verdict:
    """When a name is accepted, and when nothing is."""

    # --- breadth.py: learnt from an opened batch, whose plants have forms of their own ---
    stretches: int = tuned(24, "stretches", "of all runs, at least", "run time")
    stretches_of_a_run: int = tuned(3, "stretches", "at least", "run time")
    stretches_apart: int = tuned(
        2, "stretches", "where an effect gains most, and as many where it loses most: not counted"
    )
    broad: float = tuned(2.0, "nats", "that an effect must gain in all others: seven to one")
    tested: float = tuned(8.0, "nats", "a model so far behind the best is not tested", "run time")

    # --- decide.py ---
    nameless_most: float = tuned(
        0.5, "share", "of the probability, without an effect: more is `unlisted`"
    )
    alike: float = tuned(2.0, "nats", "log odds: effects less apart cannot be told apart")
    explained_share: float = tuned(
        0.1, "share", "of the misfit that names must take to be an explanation"
    )
    rivals: int = tuned(
        3, "models", "of a size, beside which what has no name is fitted", "run time"
    )
    power: float = tuned(
        0.4, "share", "of the effects that must be detectable at their expected size: consistent"
    )
    quiet_temperature: float = tuned(2.0, "-", "of the screen's evidence where nothing alarms")
    quiet_weight: float = tuned(20.0, "-", "of no effect at all where nothing alarms")
    quiet_most: float = tuned(20.0, "nats", "of an effect's evidence where nothing alarms")

    # --- nameless.py ---
    function_sizes: tuple[float, ...] = tuned(
        (1.0, 5.0), "-", "of a function, in its expected size, where it is fitted"
    )
    together: int = tuned(4, "functions", "that may act together", "run time")
