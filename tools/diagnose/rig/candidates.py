"""Which effects the recordings of a wheel can show."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.rig.signals import Signals


def candidates(signals: Sequence[Signals], left_out: Collection[str]) -> dict[str, type[Effect]]:
    """The effects to look for, by name: of steady states only what they can show."""
    listed = {n: e for n, e in EFFECTS.items() if not e.filter_only and n not in left_out}
    if not tables(signals):
        return listed
    shown = {name: effect.in_steady_states() for name, effect in listed.items()}
    return {name: effect for name, effect in shown.items() if effect is not None}


def tables(signals: Sequence[Signals]) -> bool:
    """Whether all recordings are tables of steady states."""
    return all(steady_states(s) for s in signals)


def steady_states(signals: Signals) -> bool:
    """Whether a recording is a table of steady states, as it says itself: time, place and wheel
    angle in it mean nothing. Short runs at steady speeds are none.
    """
    return signals.info.steady_states


def unbroken(signals: Signals) -> list[Index]:
    """The stretches between silences, of a table its rows: which values (n,) each has."""
    known = np.flatnonzero(np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate))
    stretches = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    return [at for at in stretches if at.size]
