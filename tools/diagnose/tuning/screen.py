"""Tuned numbers of tools/diagnose/screen: what stands out of the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.tools.diagnose.tuning.field import tuned

COLOUR_SIZES = (0.8, 0.9, 1.0, 1.1, 1.25, 1.5)


@dataclass(frozen=True)
class ScreenTuning:
    """When evidence is an alarm, and what is searched for."""

    # --- screening.py ---
    level: float = tuned(0.01, "probability", "of a false alarm: half of what is allowed")
    line: float = tuned(
        1e-4,
        "probability",
        "of a ripple at full rate by chance, from which it is an alarm by itself",
    )
    kinds: int = tuned(10, "kinds", "of misfit that count as independent, of all that are tried")

    # --- ripples.py ---
    loudest: int = tuned(10, "orders", "whose physics is simulated", "run time")

    # --- open_colour.py ---
    colour_sizes: tuple[float, ...] = tuned(
        COLOUR_SIZES, "-", "of the noise, beside what suits a channel for itself"
    )

    # --- covered.py ---
    reference_open: float = tuned(
        0.3, "share", "of the discrepancy's variance that the reference may leave open"
    )
    # --- scans.py ---
    step_places: int = tuned(48, "places", "of a step along an axis", "run time")
    step_width: float = tuned(
        0.015, "-", "of the whole stretch: a wheel is on both sides of a step for a while"
    )

    @property
    def sure(self) -> float:
        """A likelihood ratio [nats] that is chance as rarely as an alarm is false, in any kind of
        misfit.
        """
        return float(np.log(self.kinds / self.level))
