"""What the configuration says of effects: how their parameters are read, and the effects as
configured.
"""

from __future__ import annotations

from collections.abc import Iterable

from gritd.estimator.config.kinds import NumberWithUnit
from gritd.estimator.config.settings import ConfiguredEffect
from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.base import Effect


def quantities(name: str) -> dict[str, NumberWithUnit] | None:
    """How each parameter of an effect is read; None for no such effect."""
    if name not in EFFECTS:
        return None
    return {
        p.name: NumberWithUnit(p.unit, low=p.low if p.stated is None else p.stated, high=p.high)
        for p in EFFECTS[name].parameters()
    }


def configured(effects: Iterable[ConfiguredEffect]) -> tuple[Effect, ...]:
    """Effects of a configuration at their configured values."""
    return tuple(
        make(e.name, {key: value.value for key, value in e.parameters.items()}) for e in effects
    )
