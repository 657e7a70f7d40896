"""Sensors that scatter by more than the configuration states of one reading."""

from __future__ import annotations

from collections.abc import Iterator

from gritd.estimator.config.channels import UNITS
from gritd.estimator.config.settings import Settings
from gritd.estimator.plausibility.contradiction import Contradiction
from gritd.estimator.plausibility.driven import DrivenRun

LOUDER = 1.5  # times the stated noise: less moves no σ of an estimate by half
AXES = {"fx": ("force_noise", "N"), "fz": ("force_noise", "N"), "ty": ("torque_noise", "N*m")}


def louder(run: DrivenRun, settings: Settings) -> Iterator[Contradiction]:
    """Each channel, or axis of the wrench, with the noise that its configuration is to state."""
    for name, scatter in run.scatter.items():
        stated, key, unit = _stated(name, settings)
        if scatter > LOUDER * stated > 0.0:
            size, times = f"{scatter:.2g} {unit}", f"{scatter / stated:.2g} times"
            text = (
                f"a reading of {name} scatters by {size}, {times} the noise of its configuration: "
                f"state {key}: {size}, or see what shakes it"
            )
            yield Contradiction(name, text)


def _stated(name: str, settings: Settings) -> tuple[float, str, str]:
    """The noise [raw] of a channel or an axis of the wrench, 0 for one that is not read; the key
    that states it, and its unit.
    """
    if name in settings.channels:
        return settings.channels[name].noise, "noise", UNITS[name][2]
    wrench = settings.wrench
    if wrench is None or name not in AXES or (name == "fx" and not wrench.pulls):
        return 0.0, "", ""
    key, unit = AXES[name]
    return getattr(wrench, key), key, unit
