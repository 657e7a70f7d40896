"""Worlds in which a testbed may stand. In one of them Eqs. (1)-(10) hold; the diagnosis knows of
none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.tools.proof.blind.plant.baseline import BottomPeak, LeakingSensor, Relaxation, WornGear
from gritd.tools.proof.blind.plant.bed import BedForm, EquationBed
from gritd.tools.proof.blind.plant.effect import PlantEffect
from gritd.tools.proof.blind.plant.strips import StripBed

PAPER = "paper"
# Names of the library that say a part of what a world has of its own.
HELD: dict[str, tuple[str, ...]] = {
    PAPER: (),
    "bottom": ("stress_peak_shift", "rear_contact"),
    "relaxation": ("contact_relaxation", "running_in"),
    "gear": (
        "coulomb_friction",
        "asymmetric_friction",
        "load_dependent_friction",
        "torque_constant_error",
        "gear_ripple",
        "force_crosstalk",
    ),
    "strips": ("stress_peak_shift", "rear_contact", "contact_relaxation", "running_in"),
}
HELD["several"] = HELD["bottom"] + HELD["relaxation"] + HELD["gear"]
WORLDS = (PAPER, "bottom", "relaxation", "gear", "several", "strips")
FOREIGN = WORLDS[1:]

# A rut that stays is a second pass of its own: what it adds is no effect beside it.
BARRED: dict[str, tuple[str, ...]] = {"strips": ("multipass",)}
MILD = 0.6  # of the usual size, where several effects come together


@dataclass(frozen=True)
class Size:
    """What the sizes of baseline effects are shares of."""

    weight: float  # [N]
    radius: float  # [m]

    @property
    def torque(self) -> float:
        """Usual torque [N·m]."""
        return 0.4 * self.weight * self.radius


def concealable(world: str, names: tuple[str, ...]) -> list[str]:
    """What can be new in a world: what is not of its own already."""
    barred = (*HELD[world], *BARRED.get(world, ()))
    return [name for name in names if name not in barred]


def drawn(
    world: str, rng: np.random.Generator, size: Size
) -> tuple[BedForm, tuple[PlantEffect, ...]]:
    """The bed and the baseline effects of a world; sizes by chance."""
    if world == "strips":
        return StripBed(recovery=float(rng.uniform(0.02, 0.1))), ()
    return EquationBed(), _baseline(world, rng, size)


def _baseline(world: str, rng: np.random.Generator, size: Size) -> tuple[PlantEffect, ...]:
    if world == "bottom":
        return (_bottom(rng),)
    if world == "relaxation":
        return (_relaxation(rng, 1.0),)
    if world == "gear":
        return _gear(rng, size, 1.0)
    if world == "several":
        return _bottom(rng), _relaxation(rng, MILD), *_gear(rng, size, MILD)
    return ()


def _bottom(rng: np.random.Generator) -> PlantEffect:
    return BottomPeak(*(float(rng.uniform(*of)) for of in ((0.08, 0.2), (0.0, 0.2), (0.04, 0.2))))


def _relaxation(rng: np.random.Generator, share: float) -> PlantEffect:
    length, deeper = share * float(rng.uniform(0.02, 0.05)), float(rng.uniform(1.0, 2.0))
    return Relaxation(length, deeper, bool(rng.integers(2)))


def _gear(rng: np.random.Generator, size: Size, share: float) -> tuple[PlantEffect, ...]:
    scale = share * size.torque
    gear = WornGear(
        share * float(rng.uniform(0.05, 0.2)),
        scale * float(rng.uniform(0.1, 0.3)),
        scale * float(rng.uniform(0.05, 0.15)),
        int(rng.integers(12, 70)),
        float(rng.uniform(0.0, 2.0 * np.pi)),
    )
    leaks = share * rng.uniform(-1.0, 1.0, 4) * (0.04, 0.1 / size.radius, 0.03, 0.1 * size.radius)
    return gear, LeakingSensor(*leaks.tolist())
