"""Tuned numbers of tools/diagnose/explain: where, how sure, what to do next, and the wording."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned


@dataclass(frozen=True)
class Explain:
    """What of a diagnosis is reported."""

    # --- held_against.py, learnt.py ---
    beyond: float = tuned(0.02, "-", "of the range: farther out a covariate is outside")

    # --- doubts.py, result.py ---
    doubtful: float = tuned(3.0, "σ", "from what is known, or times the stated noise: reported")
    strained_soil: float = tuned(2.0, "σ", "from what was known: a soil parameter is reported")

    # --- experiment.py ---
    foreseen_error: float = tuned(
        0.02, "-", "of a channel's size: no rival predicts an experiment better than this"
    )

    # --- explanation.py ---
    shown: int = tuned(4, "lines, runs, or scatters", "that are shown of many")

    # --- soil.py ---
    stated_far: float = tuned(4.0, "σ", "by which what is wrong is usually off")
    precision_freedom: float = tuned(
        4.0, "-", "independent conditions from which the recordings' own σ is known, about"
    )

    # --- law.py ---
    law_leaves: float = tuned(0.1, "share", "of the misfit at most: else the law is none of it")

    # --- locate.py ---
    least_share: float = tuned(0.05, "-", "of a misfit: less is not worth naming")

    # --- learnt.py: δ as a configuration holds it ---
    learnt_points: int = tuned(20, "points", "at most: a configuration stays readable")
    learnt_directions: int = tuned(8, "directions", "at most: a configuration stays readable")
    learnt_places: int = tuned(
        4, "decimals", "of means; directions and correlations have one less, points two"
    )
    learnt_ridge: float = tuned(1e-4, "-", "of the features' squares, against rounding")
    learnt_beyond: float = tuned(
        0.005, "quantile", "of slip, load and speed that may lie beyond either end of the domain"
    )
    learnt_outside: float = tuned(
        0.03, "-", "σ of δ, in its size, that is new where it was not learnt", "run time"
    )
