"""What was learnt of δ, the discrepancy of form (discrepancy.py), as a configuration holds it.

With the features φ(x) of a few inducing points, the δ of one channel at the conditions x is

    δ(x) = w(x) s [ρ(x) φ(x) (μ + Σ_j b_j v_j) + u(x) ε],   b_j, ε ~ N(0, 1)
    u²   = 1 − ρ² min(|φ|² + 0.02, 1) (1 − e²)

with the size s, the weight w in proportion to the load (0 outside contact, signed by the direction
for torque and drawbar pull), the mean μ, r directions v_j in which δ is still uncertain, and the
rest u of its variance: e² of it inside the domain. Outside the domain ρ goes from 1 to 0, over the
lengths of discrepancy.py, and δ goes back to its prior N(0, s²). The b_j are the same in all
channels and correlated with the soil that δ was learnt with: what δ took, the soil did not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Vector = tuple[float, ...]
CHANNELS = ("torque", "drawbar_pull", "sinkage")  # in this order wherever there are three
SIGNED = (True, True, False)  # whether a channel turns with the direction


@dataclass(frozen=True)
class ChannelForm:
    """δ of one channel, for m points and r directions."""

    size: float  # s, at the usual load [N·m, N or m]
    mean: Vector  # μ (m,)
    spread: tuple[Vector, ...]  # v_j (r, m)
    rest: float = 0.0  # e


@dataclass(frozen=True)
class Domain:
    """Where δ was learnt."""

    slip: tuple[float, float]
    load: tuple[float, float]  # [N]
    speed: tuple[float, float]  # of the rim [m/s]
    travel: Literal["forward", "backward", "both"] = "forward"


@dataclass(frozen=True)
class LearntSoil:
    """The soil that δ was learnt with: c [Pa], tan φ and k [m] as they were written with it.

    with_…: correlation (r,) of each with the b_j; among: of c with tan φ, of c with k, of tan φ
    with k.
    """

    cohesion: float
    tan_phi: float
    shear_modulus: float
    with_cohesion: Vector
    with_tan_phi: Vector
    with_shear_modulus: Vector
    among: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def values(self) -> tuple[float, float, float]:
        return self.cohesion, self.tan_phi, self.shear_modulus

    @property
    def correlations(self) -> tuple[Vector, Vector, Vector]:
        """(3, r)."""
        return self.with_cohesion, self.with_tan_phi, self.with_shear_modulus


@dataclass(frozen=True)
class LearntForm:
    """δ of the channels of which it was learnt, one at least; of the others nothing is known.

    points: conditions (m, d), in units of the lengths of discrepancy.py.
    """

    load: float  # usual load, from which conditions count [N]
    speed: float  # usual rim speed [m/s]
    domain: Domain
    points: tuple[Vector, ...]
    torque: ChannelForm | None = None
    sinkage: ChannelForm | None = None
    drawbar_pull: ChannelForm | None = None
    soil: LearntSoil | None = None

    @property
    def channels(self) -> tuple[ChannelForm | None, ChannelForm | None, ChannelForm | None]:
        """In the order of CHANNELS."""
        return self.torque, self.drawbar_pull, self.sinkage

    @property
    def directions(self) -> int:
        """r."""
        return next((len(c.spread) for c in self.channels if c is not None), 0)
