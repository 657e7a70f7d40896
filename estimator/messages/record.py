"""What one tick says: the fields of /tick and /loop, in order, with units.

`TickRecord` is a plain mapping by name while it is built and a tuple in this order when it is
logged, so a reader of a recording and a reader of this file see the same list.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag

Field = tuple[str, str, str]  # (name, ros type, meaning with unit)


class Status(IntEnum):
    """Why the estimate moves or stands still."""

    STARTING = 0  # not every required channel has filled a window yet
    TRACKING = 1  # the filter is updated
    STALE = 2  # a required channel is silent, or sends nothing usable
    STUCK = 3  # a channel stands still while the others move
    IN_AIR = 4  # no load, or no sinkage: nothing touches the soil
    STANDSTILL = 5  # neither wheel nor carriage moves
    STALL = 6  # the wheel digs without travel, or is blocked under current
    REVERSE = 7  # backwards: over soil it has already compacted
    BRAKING = 8  # the carriage pushes the wheel: the linearised shear displacement does not hold
    UNCERTAIN = 9  # slip or entry angle not known well enough to be worth an update
    UNSTEADY = (
        10  # speed, load or sinkage changes from window to window: Eqs. 1–22 hold in steady motion
    )


class Flag(IntFlag):
    """Conditions that may hold beside the status."""

    NONE = 0
    NOT_SEPARABLE = 1  # c and tan φ not told apart by the data so far: use the joint ellipse
    K_ESTIMATED = 2  # ln k is estimated; otherwise considered
    GATED = 4  # a measurement of this window failed its gate
    RESET = 8  # covariance was inflated after the innovations disagreed
    MISMATCH = 16  # innovations larger than their stated size: model and measurement disagree
    LATE_READINGS = 32  # readings older than the horizon were dropped since the last tick
    COUNTER_JUMP = 64  # an encoder jumped and was re-baselined since the last tick
    LOAD_ASSUMED = 128  # W is the configured load, not a measurement


CHANNEL_BITS = {
    "wheel_encoder": 1,
    "carriage_encoder": 2,
    "sinkage_pot": 4,
    "motor_shunt": 8,
    "wrench": 16,
    "motor_temperature": 32,
}


def _pair(name: str, unit: str, meaning: str) -> tuple[Field, Field]:
    return (name, "float64", f"{meaning} [{unit}]"), (
        f"{name}_sigma",
        "float64",
        f"its standard deviation [{unit}]",
    )


def _aid_source(channel: str, unit: str) -> tuple[Field, ...]:
    """The record every measurement update leaves (STYLE rule 6), zero-filled where there was no
    update.
    """
    return (
        (f"{channel}_z", "float64", f"measurement offered to the filter [{unit}]"),
        (f"{channel}_r", "float64", f"its variance, all known noise included [{unit}²]"),
        (
            f"{channel}_innovation",
            "float64",
            f"measurement minus prediction before the update [{unit}]",
        ),
        (f"{channel}_s", "float64", f"innovation variance [{unit}²]"),
        (f"{channel}_test_ratio", "float64", "innovation² / (gate² · S) [-]"),
        (f"{channel}_accepted", "bool", "true only if it was applied"),
    )


TICK_FIELDS: tuple[Field, ...] = (
    ("stamp", "builtin_interfaces/Time", "tick time"),
    (
        "evaluated",
        "builtin_interfaces/Time",
        "the instant the tick describes: centre of the window",
    ),
    ("sequence", "uint64", "number of the tick since the start of the run, missed ones counted"),
    ("consumed", "uint32", "readings handed to this tick"),
    ("status", "uint8", "Status"),
    ("flags", "uint16", "Flag bits"),
    ("stale", "uint8", "silent channels, CHANNEL_BITS"),
    ("stuck", "uint8", "stuck channels, CHANNEL_BITS"),
    ("late", "uint32", "readings dropped as older than the horizon, since the start"),
    ("duplicates", "uint32", "readings dropped as duplicates, since the start"),
    ("jumps", "uint32", "encoder jumps re-baselined, since the start"),
    ("invalid", "uint32", "readings refused as non-finite or out of range, since the start"),
    ("wheel_angle", "float64", "[rad]"),
    *_pair("wheel_speed", "rad/s", "ω"),
    ("carriage_position", "float64", "[m]"),
    *_pair("carriage_speed", "m/s", "v"),
    *_pair("slip", "-", "i"),
    *_pair("sinkage", "m", "z"),
    *_pair("theta_1", "rad", "entry angle θ₁"),
    ("theta_m", "float64", "angle of maximum stress θₘ [rad]"),
    ("current", "float64", "motor current [A]"),
    ("temperature", "float64", "motor temperature [°C], NaN without the sensor"),
    *_pair("torque", "N·m", "T measured at the axle"),
    *_pair("load", "N", "W measured, or configured"),
    *_pair("drawbar_pull", "N", "DP measured, NaN without the sensor"),
    *_pair("cohesion", "Pa", "c"),
    *_pair("tan_phi", "-", "tan φ"),
    *_pair("shear_modulus", "m", "k"),
    ("cov_c_tan_phi", "float64", "[Pa]"),
    ("cov_c_ln_k", "float64", "[Pa]"),
    ("cov_tan_phi_ln_k", "float64", "[-]"),
    *_pair("torque_predicted", "N·m", "T from Eq. 22 at the estimate"),
    *_pair("load_predicted", "N", "W from Eq. 21 with σₘ of Eq. 3 and the prior moduli"),
    *_pair("drawbar_pull_predicted", "N", "DP from Eq. 20 at the estimate"),
    *_pair("rolling_resistance", "N", "second term of Eq. 8"),
    *_pair("drawbar_pull_max", "N", "largest DP over slip at this load and sinkage"),
    ("drawbar_pull_max_slip", "float64", "the slip at which it is reached [-]"),
    (
        "separability",
        "float64",
        "posterior over prior σ in the weakest direction of (c, tan φ) [-]",
    ),
    (
        "consistency",
        "float64",
        "mean normalised innovation squared per measurement over 2 s, 1 when honest [-]",
    ),
    ("updates", "uint64", "filter updates applied since the start"),
    ("resets", "uint32", "covariance resets since the start"),
    *_aid_source("torque", "N·m"),
    *_aid_source("drawbar_pull", "N"),
)

LOOP_FIELDS: tuple[Field, ...] = (
    ("stamp", "builtin_interfaces/Time", "tick time"),
    ("lateness", "float64", "wake-up minus deadline [s]"),
    ("duration", "float64", "time the tick took [s]"),
    ("missed", "uint64", "ticks missed since the start"),
    ("queued", "uint32", "readings waiting when the tick began"),
    ("dropped", "uint64", "readings the queue dropped since the start"),
    ("log_queued", "uint32", "messages waiting for the writer"),
    ("log_dropped", "uint64", "messages the writer dropped since the start"),
    ("wall_offset", "float64", "wall clock minus the daemon's clock [s]; a step shows here"),
)

TICK_NAMES = tuple(name for name, _, _ in TICK_FIELDS)
NOT_A_NUMBER = float("nan")
