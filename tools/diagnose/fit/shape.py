"""A misfit without a name: in which channel, along what, and of which kind."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal["smooth", "wave", "step", "window", "strain"]


@dataclass(frozen=True)
class Shape:
    """A misfit of one channel along one covariate, or along the product of two; or the strain of a
    constant, whose name then stands for the channel and along what.

    at:     frequency [1/s, 1/m, 1/rad] of a wave, place [s, m, …] of a step, where a window begins;
            None for all of them together.
    until:  where a window ends.
    shared: of a wave, whether all stretches of the recordings have one phase.
    """

    channel: str
    along: tuple[str, ...]
    kind: Kind = "smooth"
    at: float | None = None
    shared: bool = False
    until: float | None = None

    @property
    def family(self) -> Shape:
        """All waves, steps or windows of the channel along the covariate, this one among them."""
        return replace(self, at=None, shared=False, until=None)

    @property
    def places(self) -> tuple[float, ...]:
        """Where a step or window begins and ends."""
        if self.kind not in ("step", "window"):
            return ()
        return tuple(at for at in (self.at, self.until) if at is not None)


Candidate = str | Shape  # what may explain a misfit: an effect, by its name, or a shape
