"""Tuned numbers of tools/diagnose/rig: readings, states and constants of a testbed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gritd.tools.diagnose.tuning.field import tuned

DESIGN = "order of magnitude of common instruments"
PREPARED = {"c": 0.1, "tan_phi": 0.02, "k": 0.05, "n": 0.01, "K": 0.08}
FLOORS = {"c": 0.05, "tan_phi": 0.02, "k": 0.03, "n": 0.01, "K": 0.02}
LEAST = {"c": 1.0, "tan_phi": 0.05, "n": 0.3}
RATES = ((400.0, 10.0), (1200.0, 5.0), (float("inf"), 2.5))


@dataclass(frozen=True)
class RigTuning:
    """How recordings become comparable values, and what is known of constants beforehand."""

    # --- adapter.py ---
    rates: tuple[tuple[float, float], ...] = tuned(
        RATES, "choice", "[s, Hz] grid of runs that are together up to so long", "run time"
    )

    # --- campaign.py ---
    quadrature_order: int = tuned(
        6, "nodes", "of a zone of the contact: leaves 4e-6 of the torque", "convergence of torque"
    )

    # --- constants.py ---
    timing: float = tuned(5e-3, "s", "a channel's stamps may be off by so much", DESIGN)
    blur: float = tuned(
        0.3, "-", "share of second differences: slopes cut corners that a channel does not"
    )
    soil_floors: Mapping[str, float] = tuned(
        FLOORS, "-", "least relative sigma: no soil is known better"
    )
    soil_least: Mapping[str, float] = tuned(
        LEAST, "-", "c in Pa, the others without a unit: no soil has less"
    )
    lean: float = tuned(0.02, "-", "of a force sensor across the wheel: a share of the load; 1°")
    scale_floor: float = tuned(
        1e-3,
        "-",
        "relative: no scale and no weights are known better; closer ones are one stack",
        DESIGN,
    )
    own_weights: float = tuned(
        0.7, "-", "part of a common error of the weights that each set may have for itself"
    )

    # --- drive.py ---
    fine_rate: float = tuned(
        250.0, "Hz", "at most: position and current are averaged on it, the model evaluated"
    )
    filter_order: int = tuned(4, "order", "of the zero-phase low-passes")
    sharp_cutoff: float = tuned(0.12, "-", "of the fine rate: cut-off of position and torque")
    band_cutoff: float = tuned(0.4, "-", "of the comparison's rate: cut-off of the comparison")
    stamps: float = tuned(
        2.0, "samples", "current and position may be apart: a held output, a bus, a mean"
    )
    shortest_log: float = tuned(2.0, "s", "a shorter log is refused")
    log_edge: float = tuned(0.2, "s", "at either end, where a filter lacks its neighbours")
    usual_torque: float = tuned(
        2.0, "unit", "size of a drive's torque: that of the wheel the priors were made for"
    )
    unknown_drive: float = tuned(
        10.0, "-", "sigma of a constant not known, in what would take all of the torque"
    )

    # --- motion_error.py ---
    other_weights: float = tuned(
        0.25, "-", "relative distance from a run's level: beyond it, other weights hang on the axle"
    )
    load_parts: int = tuned(8, "parts", "of a run, whose mean loads tell the error of all")

    # --- proposals.py ---
    proposal_seconds: float = tuned(24.0, "s", "length of a foreseen experiment")

    # --- signals.py ---
    longest: float = tuned(
        86_400.0, "s", "of a recording: what is sought over its time grows with this", "memory"
    )
    encoder_readings: int = tuned(
        10, "values", "of an encoder, of a recording on its grid, or at one load at least"
    )
    drive_readings: int = tuned(100, "readings", "of each channel of a drive's log at least")

    # --- states.py, drive.py, proposals.py ---
    creep: float = tuned(0.05, "-", "of the usual speed, or of the largest load: below it is rest")
    settling: float = tuned(
        0.5, "s", "after a start or a stop at least, and before the next, no value counts"
    )
    longest_settling: float = tuned(5.0, "s", "after the wheel starts, at most")
    contact_angle: float = tuned(
        0.7, "rad", "usual entry angle: by then the rim has passed one contact and has sunk"
    )
    turning_speed: float = tuned(1e-3, "m/s", "a slower rim does not turn")
    rest_speed: float = tuned(0.01, "-", "of the usual rim speed: slower is the encoder's noise")
    lifted: float = tuned(0.2, "-", "of the stated or least load: below it the wheel is lifted")

    # --- motion_error.py, noise/estimate.py ---
    unrest_values: int = tuned(61, "values", "whose median is the speed of a held condition")
    unrest_most: float = tuned(7.5, "times", "the usual unrest: beyond, the motion changes")
    unrest_largest: float = tuned(0.03, "-", "usual unrest: more is no noise of a speed sensor")

    # --- weights.py ---
    close_load: float = tuned(
        0.15, "-", "relative distance of two loads at which both mean the same"
    )
    passing: float = tuned(0.1, "-", "part of a run that may pass between lifted and loaded")
    doubt: float = tuned(
        4.0, "σ", "of weights, a current at rest, a line, or a constant: beyond, they are others"
    )
    load_moment: float = tuned(2.0, "σ", "of a mean load: within it means over two moments agree")
    hold: float = tuned(1.0, "s", "weights and speeds are held for at least so long")

    # --- wheel.py ---
    holding: float = tuned(
        0.05, "-", "of the torque that is compared: current at rest that differs by more is held"
    )
    slope_edge: int = tuned(2, "intervals", "at a run's ends a slope lacks its neighbours")
    unknown_offset: float = tuned(
        1e5, "N or N·m", "an offset less certain says that the channel was not measured"
    )
    prepared: Mapping[str, float] = tuned(
        PREPARED, "-", "relative repeatability of a bed that is raked and levelled anew"
    )

    # --- relief.py ---
    relief: float = tuned(
        5e-4,
        "m",
        "standard deviation of a surface that was raked and levelled anew",
        "judgement: a board levels to about half a millimetre",
    )
    shortest_relief: float = tuned(0.1, "m", "wave of such a surface: a board bridges shorter ones")
    most_reliefs: int = tuned(12, "half waves", "of such a surface along a run", "run time")

    @property
    def rate(self) -> float:
        """[Hz] of the finest grid."""
        return self.rates[0][1]
