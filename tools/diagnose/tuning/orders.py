"""Tuned numbers of tools/diagnose/orders: ripples and vibrations at the recordings' own rate."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned

NEIGHBOURS = "spectra of white and red noise"


@dataclass(frozen=True)
class Orders:
    """What counts as a line in a spectrum against the wheel angle."""

    # --- stretches.py ---
    changed: float = tuned(0.02, "-", "relative change of a speed or load within `apart`: a ramp")
    apart: float = tuned(0.3, "s", "over which a change of speed or load is looked for")
    change_noise: float = tuned(5.0, "σ", "of their own noise: less is no ramp")
    longest_part: float = tuned(20.0, "turns", "a longer run is cut, each part its own phase")

    # --- spectrum.py ---
    trend: int = tuned(2, "degree", "of the polynomial that each stretch loses")
    cycles: float = tuned(2.0, "cycles", "at least in the longest stretch")
    density: float = tuned(4.0, "-", "places tried in each that the longest run resolves")
    nyquist: float = tuned(0.45, "-", "of the samples: a faster ripple is an alias")
    highest_order: float = tuned(400.0, "1/turn", "tried: the library's 200 and a harmonic of it")
    highest_frequency: float = tuned(
        60.0, "Hz", "tried in time: the grid damps what is faster twentyfold", "run time"
    )
    near: float = tuned(1.5, "cells", "nearer in the spectrum is the line itself")
    far: float = tuned(8.0, "cells", "as far the spectrum of the noise is smooth", NEIGHBOURS)

    # --- lines.py ---
    level: float = tuned(0.002, "probability", "of a line in noise, all that are tried counted")
    most_lines: int = tuned(16, "lines", "at most", "run time")
    prefer_angle: float = tuned(
        3.0, "nats", "at one speed a ripple of the wheel is also one in time: the wheel's is meant"
    )
    supports: float = tuned(2.0, "nats", "of each: less is chance, three places are tried in each")
    behind: float = tuned(10.0, "nats", "of support: orders so far behind the best are no count")
    known: float = tuned(0.5, "-", "of a line's size: of as much in the reference it is not new")
    harmonics: int = tuned(6, "times", "the order of a louder line: its harmonic")

    # --- phases.py ---
    two_speeds: float = tuned(1.2, "-", "fastest over slowest: one speed cannot tell a ripple")
    out_of_step: float = tuned(0.6, "rad", "of a ripple: runs that differ by less begin alike")
