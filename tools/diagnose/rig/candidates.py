"""Which effects the recordings of a wheel can show."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.rig.signals import Signals


def candidates(signals: Sequence[Signals], left_out: Collection[str]) -> dict[str, type[Effect]]:
    """The effects to look for, by name: of steady states only what they can show."""
    listed = {n: e for n, e in EFFECTS.items() if not e.filter_only and n not in left_out}
    if not tables(signals):
        return listed
    shown = {name: effect.in_steady_states() for name, effect in listed.items()}
    return {name: effect for name, effect in shown.items() if effect is not None}


def tables(signals: Sequence[Signals]) -> bool:
    """Whether all recordings are tables of steady states, as they say themselves: time, place and
    wheel angle in them mean nothing. Short runs at steady speeds are none.
    """
    return all(s.info.steady_states for s in signals)
