"""The tuned numbers that are in force."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from gritd.tools.diagnose.tuning.explain import Explain
from gritd.tools.diagnose.tuning.fit import FitTuning
from gritd.tools.diagnose.tuning.noise import NoiseTuning
from gritd.tools.diagnose.tuning.numerics import Numerics
from gritd.tools.diagnose.tuning.orders import Orders
from gritd.tools.diagnose.tuning.rig import RigTuning
from gritd.tools.diagnose.tuning.screen import ScreenTuning
from gritd.tools.diagnose.tuning.search import SearchTuning
from gritd.tools.diagnose.tuning.verdict import Verdict


@dataclass
class Tuning:
    """The numbers of every room. Only `replaced` puts another room's numbers in."""

    numerics: Numerics = field(default_factory=Numerics)
    orders: Orders = field(default_factory=Orders)
    rig: RigTuning = field(default_factory=RigTuning)
    noise: NoiseTuning = field(default_factory=NoiseTuning)
    fit: FitTuning = field(default_factory=FitTuning)
    screen: ScreenTuning = field(default_factory=ScreenTuning)
    search: SearchTuning = field(default_factory=SearchTuning)
    verdict: Verdict = field(default_factory=Verdict)
    explain: Explain = field(default_factory=Explain)


TUNING = Tuning()


@contextmanager
def replaced(room: str, **values: Any) -> Iterator[None]:
    """Other numbers of a room, for a while. Raises AttributeError, TypeError for unknown names."""
    before = getattr(TUNING, room)
    setattr(TUNING, room, replace(before, **values))
    try:
        yield
    finally:
        setattr(TUNING, room, before)
