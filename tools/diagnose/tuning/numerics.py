"""Steps, rounds and ends of numerical methods, and how much is held in memory at once.

They are no tuned numbers: where all of them are halved, or doubled, a diagnosis stays what it is
(tests/tools/diagnose/test_sensitivity.py).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Numerics:
    """How sums, fits and searches are carried out."""

    # --- how a fit descends ---
    # [nats] a step that would gain less ends a descent: linear algebra tells the rest
    gain: float = 0.05
    damping_start: float = 1e-3  # of the curvature: first damping
    # factor on the damping after a step that failed; after a good one its inverse
    damping: float = 5.0
    fulfilled: float = 0.1  # share of the expected gain: a step is taken
    good: float = 0.75  # share of the expected gain: the damping falls
    rounds: int = 20  # of a descent at most: sizes are learnt in between
    halvings: int = 7  # of the strengths of a new effect at its start, while it makes the fit worse

    # --- where it begins ---
    # [expected sizes] of a strength that has a sign: at its bound it has no slope
    least_start: float = 0.02
    farthest_start: float = 20.0  # [expected sizes] of any parameter
    least_precision: float = 0.1  # share of its precision that a strength's start keeps

    # --- how far its parameters may be ---
    reach: float = 2.0  # [σ] by which a strength is moved from where it was fitted

    # --- differences ---
    # [prior σ or expected size] for differences: small, for slopes turn where soil gives way
    step: float = 1e-4
    runaway: float = 10.0  # times the largest value measured: a change by more runs away

    # --- rounds ---
    size_rounds: int = 5  # of fit and sizes in turn: nearly always two are enough
    form_rounds: int = 2  # in which other forms are made anew where the fit stands
    calming_rounds: int = 8  # fits of the ripples that leave the least absolute values
    refinements: int = 8  # times that a line's place is looked for more finely
    sweeps: int = 3  # times that all lines of a channel are estimated anew beside another
    colour_sweeps: int = 2  # over the channels
    frequencies_near_best: int = 9  # about the best of a scan, in steps of it

    # --- what is left out ---
    slight_size: float = 1e-3  # weight of sizes below which they do not count
    shared_least: float = 0.3  # [squares of the noise] a direction that shows less is left out
    shared_most: int = 150  # directions of all effects in both campaigns
    negligible: float = 1e-5  # weight of a value long past in an innovation: it is left out
    rank: float = 1e-7  # of the largest eigenvalue: smaller ones are dependent columns
    # [nats] a colour so far behind the best for a channel alone is not tried
    colour_near: float = 10.0

    # --- held at once ---
    whitened_at_once: int = 4_000_000  # numbers, for memory
    colours_at_once: int = 16  # products of a channel's columns in noise of each, for memory
    at_once: int = 12  # signatures whitened and projected, or weighed, for memory
    most_samples: int = 1_500_000  # of a channel in all runs, for memory
    kept: int = 8  # simulations of all runs, for memory and run time
