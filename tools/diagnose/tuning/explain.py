"""Tuned numbers of tools/diagnose/explain: where, how sure, what to do next, and the wording."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned

Range = tuple[float, float]


@dataclass(frozen=True)
class Explain:
    """What of a diagnosis is reported."""

    # --- changes.py ---
    change_places: int = tuned(32, "places", "tried along a covariate", "run time")
    change_widths: tuple[float, ...] = tuned(
        (0.015, 0.05), "-", "of the whole stretch: a wheel is on both sides of a change for a while"
    )
    change_waves: int = tuned(
        12, "cosines", "of a smooth function; they fall with the square of their number, as a kink"
    )
    change_values: int = tuned(8, "values", "on either side of a change")
    swept_levels: int = tuned(8, "levels", "of a covariate at least, for it to count as swept")
    level_held: float = tuned(0.015, "-", "share of the values that makes a level")
    change_rounds: int = tuned(6, "rounds", "of one more change", "run time")
    run_share: float = tuned(
        0.5, "share", "of a channel's misfit that offsets of runs take before changes are sought"
    )
    run_nearly: float = tuned(0.93, "share", "of that, what a few steps between runs must take")
    few_run_steps: int = tuned(2, "steps", "between runs that are few")
    change_worth: float = tuned(
        0.1, "-", "of the evidence of the first part: a later change that gains less is detail"
    )
    change_range: Range = tuned((0.01, 0.99), "quantile", "of a covariate, where changes are tried")

    pays: float = tuned(3.0, "nats", "a change, a term of a law or a further place must gain")

    # --- coverage.py, learnt.py ---
    beyond: float = tuned(0.02, "-", "of the range: farther out a covariate is outside")

    # --- doubts.py, result.py ---
    loud: float = tuned(
        3.0,
        "times",
        "the stated noise of a reading: a grid value is a mean of readings",
        "judgement",
    )
    doubtful_constant: float = tuned(3.0, "σ", "from what is known: a constant is reported")
    strained_soil: float = tuned(2.0, "σ", "from what was known: a soil parameter is reported")

    # --- summary.py ---
    held_out_worse: float = tuned(
        0.1, "share", "by which the held-out error of a channel grows: an explanation in part"
    )
    bent_far: float = tuned(
        0.3, "share", "by which our form is off: more is reported as resembling"
    )

    # --- experiment.py ---
    instrument: float = tuned(
        0.2, "-", "of an expected size: what tape, level or clamp meter can tell"
    )
    foreseen_error: float = tuned(
        0.02, "-", "of a channel's size: no rival predicts an experiment better than this"
    )
    foreseen_together: int = tuned(10, "values", "that count as one: neighbours share their noise")
    gain_enough: float = tuned(10.0, "nats", "decide")
    rivals: int = tuned(4, "explanations", "that an experiment is to distinguish", "run time")
    gain_worth: float = tuned(1.0, "nats", "from which on two are called distinguished")
    foreseen_step: float = tuned(0.1, "σ", "of a constant, for differences")

    # --- explanation.py ---
    shown_lines: int = tuned(4, "places", "of ripples and of vibrations that a note tells")
    shown_hypotheses: int = tuned(12, "hypotheses", "that are shown")
    slight_explanation: float = tuned(
        1e-2, "probability", "below which an explanation does not count for the soil"
    )

    # --- reconciled.py ---
    stated_wrong: float = tuned(
        0.01, "share", "of what is stated of soil is wrong: one in a hundred", "judgement"
    )
    stated_far: float = tuned(4.0, "σ", "by which what is wrong is usually off", "judgement")
    told_freedom: float = tuned(
        4.0, "-", "independent conditions from which the recordings' own σ is known, about"
    )
    told_least: float = tuned(1e-4, "-", "precision in the prior's: less says nothing of the soil")
    told_most: float = tuned(1e8, "-", "precision in the prior's: more is no measurement")
    summed_near: float = tuned(5.0, "-", "arsinh of the farthest point about a value", "run time")
    summed_steps: int = tuned(801, "points", "about each of the two", "run time")
    summed_far: float = tuned(40.0, "σ", "of the prior: farther is no soil")

    # --- law.py ---
    law_carries: float = tuned(
        0.9, "share", "of the misfit that a law must take to be written in place of δ"
    )
    law_domain: Range = tuned((0.005, 0.995), "quantile", "of a covariate: domain of a law")

    # --- locate.py ---
    false_discovery: float = tuned(0.05, "probability", "false-discovery rate of the list")
    places_listed: int = tuned(8, "places", "listed at most")
    least_share: float = tuned(0.05, "-", "of a misfit: less is not worth naming")
    lowest_order: float = tuned(3.0, "1/turn", "lower orders belong to the wheel's angle")
    ridge: float = tuned(1e-9, "-", "keeps normal equations regular", "rounding")

    # --- provenance.py ---
    same_value: float = tuned(1e-6, "-", "relative difference below which values are the same")
    same_wheel: float = tuned(0.1, "-", "of radius and width: more is another wheel, no correction")

    # --- remainder.py ---
    remainder_bends: int = tuned(2, "powers", "of a covariate that describe a remainder")
    remainder_share: float = tuned(
        0.2, "share", "of a remainder's squares that a covariate must take to be named"
    )
    remainder_parts: int = tuned(3, "parts", "of a covariate's range that are distinguished")
    remainder_values: int = tuned(10, "values", "needed")
    remainder_noise: float = tuned(0.5, "σ", "of the noise: a smaller remainder is within it")

    # --- traces.py ---
    pictures: int = tuned(4, "scatters", "at most")
    digits: int = tuned(6, "digits", "of what is drawn", "size of the JSON")

    # --- ripples.py ---
    one_frequency: float = tuned(1.05, "-", "ratio of two frequencies that count as one")

    # --- wording.py ---
    reads_nothing: float = tuned(1e-3, "-", "of the largest of several values: less reads 0")
    more_digits: int = tuned(3, "digits", "at most, that distinguish values")
    long_place: float = tuned(10.0, "m or s", "from which on a place has a digit more")
    equal_places: int = tuned(12, "decimals", "to which two contrasts are equal", "rounding")
    low_end: Range = tuned((0.0, 0.15), "choice", "quantiles between which a mean is taken")
    middle: Range = tuned((0.4, 0.6), "choice", "quantiles between which a mean is taken")
    high_end: Range = tuned((0.85, 1.0), "choice", "quantiles between which a mean is taken")
    middle_stands_out: float = tuned(
        0.25, "-", "of the difference between the ends: a middle that far outside is reported"
    )
    means_alike: float = tuned(0.15, "-", "of a mean: two that are closer are called the same")
    runs_named: int = tuned(6, "runs", "that are all named; of more only the farthest off")
    runs_far_named: int = tuned(3, "runs", "farthest off that are named of many")
    runs_show: float = tuned(0.6, "share", "of the squares of the runs' means that changes take")

    # --- learnt.py: δ as a configuration holds it ---
    learnt_points: int = tuned(20, "points", "at most: a configuration stays readable")
    learnt_directions: int = tuned(8, "directions", "at most: a configuration stays readable")
    learnt_places: int = tuned(
        4, "decimals", "of means; directions and correlations have one less, points two"
    )
    learnt_end_places: int = tuned(2, "decimals", "of the domain's ends of slip and load")
    learnt_speed_places: int = tuned(5, "decimals", "of the domain's ends of rim speed [m/s]")
    learnt_left_out: float = tuned(
        1e-3, "share", "of the variance that is left of δ: no further direction is kept for it"
    )
    learnt_ridge: float = tuned(1e-4, "-", "of the features' squares, against rounding")
    learnt_shrunk: float = tuned(0.999, "-", "factor on correlations that are rounded", "rounding")
    learnt_beyond: float = tuned(
        0.005, "quantile", "of slip, load and speed that may lie beyond either end of the domain"
    )
    learnt_outside: float = tuned(
        0.03, "-", "σ of δ, in its size, that is new where it was not learnt", "run time"
    )
