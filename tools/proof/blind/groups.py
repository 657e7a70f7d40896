"""Effects that say the same in most campaigns, fixed before any trial: a sceptic's list, not the
engine's.
"""

from __future__ import annotations

GROUPS: tuple[frozenset[str], ...] = (
    frozenset(
        ("bed_slope", "force_crosstalk", "side_wall_rubbing")
    ),  # drawbar pull in proportion to load
    frozenset(
        ("coulomb_friction", "asymmetric_friction", "current_offset")
    ),  # constant torque, driving forward
    frozenset(("viscous_friction", "stribeck_friction")),  # torque over speed
    frozenset(("sinkage_gain", "frame_compliance", "sinkage_datum")),  # sinkage over load
    frozenset(("pulley_slip", "wheel_radius_error")),  # slip off in proportion to travel
    frozenset(("contact_relaxation", "running_in")),  # a steady state that comes with the way
    frozenset(("torque_constant_error", "load_dependent_friction")),  # torque in proportion to load
)

# Pairs for the stratum of confounded effects, and what the campaign must not contain for them to be
# confounded.
CONFOUNDED: tuple[tuple[str, str, dict[str, bool | int]], ...] = (
    ("bed_slope", "force_crosstalk", {"reversal": False, "wrench": True}),
    ("side_wall_rubbing", "bed_slope", {"reversal": False, "wrench": True}),
    (
        "coulomb_friction",
        "current_offset",
        {"standstill": False, "lifted": False, "reversal": False},
    ),
    ("coulomb_friction", "asymmetric_friction", {"reversal": False}),
    ("sinkage_gain", "frame_compliance", {"loads": 1}),
    ("pulley_slip", "wheel_radius_error", {"wrench": False}),
)


# What a campaign must hold, or must not, for an effect to show as it is meant to.
NEEDED: dict[str, dict[str, bool | int]] = {
    "multipass": {"second_pass": True},
    "backlash": {"reversal": True},
    "load_axis_friction": {"staircase": False},  # it is in a load that is measured
    "contact_relaxation": {"reversal": False},  # forces that turn round would show little else
}


def alike(name: str) -> frozenset[str]:
    """The effect and those grouped with it."""
    return next((group for group in GROUPS if name in group), frozenset((name,)))
