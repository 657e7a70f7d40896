"""What the sensors of a rig can determine of the soil, in a line: docs/filter.md has the table."""

from __future__ import annotations

from gritd.estimator.config.settings import Settings

SOURCES = {"motor_shunt": "torque of the motor", "wrench": "torque at the axle"}


def reach(settings: Settings) -> str:
    """For check-config and info."""
    if not settings.channels["carriage_encoder"].there:
        return (
            "nothing of the soil, as a drive without a carriage; "
            "gritd calibrate torque and gritd diagnose read it"
        )
    source, wrench = settings.drive.torque_source, settings.wrench
    torque = SOURCES.get(source, "")
    pull = "drawbar pull" if wrench is not None and wrench.pulls else ""
    load = "a measured load" if wrench is not None else "a stated load"
    measured = " and ".join(part for part in (torque, pull) if part)

    found = "c, tan φ and k from two loads and three slips; at one load only their joint effect"
    if not (torque and pull):
        found += "; the place of the stress peak has to be stated for a narrow σ"
    return f"{measured} under {load}: {found}"
