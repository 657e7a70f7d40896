"""Tuned numbers of tools/diagnose/verdict: what is said of the models that were fitted."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned

COUNTED = "94 names of plants of other forms: 2 of 69 right ones needed 0.4, 18 of 25 wrong ones"


@dataclass(frozen=True)
class Verdict:
    """When a name is accepted, and when nothing is."""

    # --- calibration.py ---
    companion: float = tuned(
        0.03,
        "-",
        "of the evidence, that one more effect must gain",
        "false companions at 5,000 to 48,000 nats gained 20 to 200",
    )

    # --- decide.py ---
    odds: float = tuned(
        0.15,
        "odds",
        "of an effect where nothing shows, shared by all candidates",
        "of ten testbeds with one effect left out, one or two have a second that shows",
    )
    equally_likely: float = tuned(
        1.25, "odds", "of explanations of as many effects, below which the simplest comes first"
    )

    # --- resemblance.py, of each of `fit.form_error_sizes` ---
    share_power: float = tuned(
        4.0,
        "-",
        "of the share of the misfit that effects that are there take, as a distribution function",
        "ten opened campaigns, whose shares had a mean of 0.96",
    )
    share_power_other: float = tuned(
        1.5, "-", "the same of what resembles them", "eleven opened campaigns: 0.02 to 1"
    )
    form_own: tuple[float, ...] = tuned(
        (0.30, 0.35, 0.32, 0.03),
        "prior",
        "of the form error of an effect that is there",
        COUNTED,
    )
    form_other: tuple[float, ...] = tuned(
        (0.08, 0.10, 0.10, 0.72),
        "prior",
        "of the form error of an effect that something resembles",
        COUNTED,
    )
    place_odds: tuple[float, ...] = tuned(
        (1.0, 0.4, 0.1),
        "odds",
        "of an effect there against one resembled, for each of `fit.place_sizes`",
        "35 names of likeliest explanations: 2 of 17 right ones needed any, 8 of 18 wrong ones did",
    )
    worse: float = tuned(
        0.25,
        "odds",
        "of an effect there against one resembled, where unseen runs are predicted worse with it",
        "14 of some 140 names of sealed campaigns did so: eight right ones, six wrong ones",
    )
    alike: float = tuned(2.0, "nats", "log odds: effects less apart cannot be distinguished")
    rivals: int = tuned(
        3, "models", "of a size, beside which what has no name is fitted", "run time"
    )
    power: float = tuned(
        0.4, "share", "of the effects that must be detectable at their expected size: consistent"
    )

    # --- unexplained.py ---
    together: int = tuned(4, "functions", "that may act together", "run time")
