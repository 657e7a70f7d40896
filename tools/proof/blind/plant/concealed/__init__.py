"""The plant's own forms of the effects, by name, and physics outside the list."""

from __future__ import annotations

from gritd.tools.proof.blind.plant.concealed import (
    drive,
    frame,
    ground,
    rim,
    sensing,
    unlisted,
    wheel,
)
from gritd.tools.proof.blind.plant.effect import Effect

_MODULES = (ground, rim, wheel, frame, drive, sensing)

LISTED: dict[str, type[Effect]] = {
    effect.name: effect for module in _MODULES for effect in module.EFFECTS
}
UNLISTED: dict[str, type[Effect]] = {effect.name: effect for effect in unlisted.EFFECTS}

# What hides in the soil parameters (DESIGN 7).
ABSORBED = ("rear_contact", "shear_peak", "torque_constant_error", "force_crosstalk", "pulley_slip")
