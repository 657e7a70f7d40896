"""The plant's own forms of the effects, by name, and physics outside the list."""

from __future__ import annotations

import numpy as np

from gritd.tools.proof.blind.plant.concealed import (
    drive,
    frame,
    friction,
    ground,
    lugs,
    rim,
    sensing,
    travel,
    unlisted,
    wheel,
    zeros,
)
from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect

Forms = tuple[type[PlantEffect], ...]

_MODULES = (ground, rim, wheel, lugs, travel, frame, friction, drive, sensing, zeros)


def _by_name(effects: Forms) -> dict[str, Forms]:
    """Effects of one name are forms of one effect."""
    forms: dict[str, Forms] = {}
    for effect in effects:
        forms[effect.name] = (*forms.get(effect.name, ()), effect)
    return forms


LISTED = _by_name(tuple(effect for module in _MODULES for effect in module.EFFECTS))
UNLISTED = _by_name(unlisted.EFFECTS)

# What hides in the soil parameters (DESIGN 7).
ABSORBED = ("rear_contact", "shear_peak", "torque_constant_error", "force_crosstalk", "pulley_slip")


def drawn(name: str, rng: np.random.Generator, facts: Facts) -> PlantEffect:
    """An effect in one of its forms, at the largest plausible strength; form, sign and shapes by
    chance.
    """
    forms = LISTED.get(name) or UNLISTED[name]
    return forms[int(rng.integers(len(forms)))].drawn(rng, facts)


__all__ = ["ABSORBED", "LISTED", "UNLISTED", "drawn"]
