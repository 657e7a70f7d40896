"""What the configuration reads of an effect: its parameters, with their units and bounds."""

from __future__ import annotations

from estimator.config.schema import Quantity
from estimator.effects import EFFECTS


def quantities(name: str) -> dict[str, Quantity] | None:
    """How each parameter of an effect is read; None for no such effect."""
    if name not in EFFECTS:
        return None
    return {p.name: Quantity(p.unit, low=p.low, high=p.high) for p in EFFECTS[name].parameters()}
