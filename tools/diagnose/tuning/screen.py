"""Tuned numbers of tools/diagnose/screen: what stands out of the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.tools.diagnose.tuning.field import tuned

TAIL = "Davison and Smith 1990"
COLOUR_SIZES = (0.8, 0.9, 1.0, 1.1, 1.25, 1.5)


@dataclass(frozen=True)
class Screen:
    """When evidence is an alarm, and what is searched for."""

    # --- screen.py ---
    level: float = tuned(0.01, "probability", "of a false alarm: half of what is allowed")
    least_surprise: float = tuned(2.0, "nats", "less is no alarm, however quiet the nulls")
    line: float = tuned(
        1e-4,
        "probability",
        "of a ripple at full rate by chance, from which it is an alarm by itself",
    )
    kinds: int = tuned(10, "kinds", "of misfit that count as independent, of all that are tried")
    beside_reference: float = tuned(
        3.0,
        "nats",
        "likelihood ratio that is left with the sizes of what the rig does anyway open",
        "judgement: these sizes are learnt from both campaigns, and favour nothing new",
    )
    tail: float = tuned(
        0.1,
        "probability",
        "beyond it the tail of the nulls is exponential; evidence counts from it",
        TAIL,
    )
    counted: float = tuned(10.0, "nulls", "that must reach a value for its chance to be counted")
    trusted_tail: float = tuned(0.1, "-", "of the least chance that can be counted", TAIL)

    at_once: int = tuned(12, "signatures", "whitened and projected, or weighed, at once", "memory")

    beyond: float = tuned(
        4.0, "σ", "of a constant: farther from what is known of it is an alarm by itself"
    )

    # --- screening.py ---
    nulls: int = tuned(300, "draws", "of noise alone", "run time")
    strained: float = tuned(3.0, "σ", "expected size of a constant's error that was not foreseen")

    # --- ripples.py ---
    loudest: int = tuned(10, "orders", "whose physics is simulated", "run time")

    # --- open_colour.py ---
    colour_sizes: tuple[float, ...] = tuned(
        COLOUR_SIZES, "-", "of the noise, beside what suits a channel for itself"
    )
    colour_near: float = tuned(
        10.0, "nats", "a colour so far behind the best for a channel alone is not tried in it"
    )
    colour_sweeps: int = tuned(2, "sweeps", "over the channels")

    # --- covered.py ---
    coverage_points: int = tuned(120, "points", "inducing points at most", "run time")
    coverage_left: float = tuned(0.02, "-", "variance at which there are points enough")
    reference_open: float = tuned(
        0.3, "share", "of the discrepancy's variance that the reference may leave open"
    )
    least_covered: float = tuned(
        0.02,
        "share",
        "of the new campaign that counts as covered at least: an alarm where the reference was not "
        "driven needs fifty times the evidence",
        "at a fifth, three of five pairs with nothing new alarmed of which none was covered",
    )

    # --- habit.py ---
    habit: float = tuned(
        2.0,
        "-",
        "times the surprise that a run of the reference shows of the same kind, or of any: news "
        "needs more",
        "47 pairs with nothing new, and 11 alarms of pairs with something",
    )

    # --- scans.py ---
    step_places: int = tuned(48, "places", "of a step along an axis", "run time")
    step_values: int = tuned(8, "values", "on either side of a step")
    step_width: float = tuned(
        0.015, "-", "of the whole stretch: a wheel is on both sides of a step for a while"
    )
    peaks: int = tuned(4, "shapes", "of a family that are fitted", "run time")
    wave_density: float = tuned(
        4.0, "-", "frequencies tried in each that the whole campaign resolves"
    )
    ripple_harmonics: int = tuned(4, "harmonics", "of a ripple that is known")
    large_ripple: float = tuned(3.0, "-", "their standard deviation in expected sizes")
    frequencies_near_best: int = tuned(9, "frequencies", "about the best, in steps of the scan")

    @property
    def sure(self) -> float:
        """A likelihood ratio [nats] that is chance as rarely as an alarm is false."""
        return float(np.log(self.kinds / self.level))
