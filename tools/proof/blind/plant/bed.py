"""What answers to the wheel: a bed under it. One kind holds to Eqs. (1)-(10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from gritd.tools.proof.blind.plant.axle import balance, settled
from gritd.tools.proof.blind.plant.contact import reaction, thinned
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import HANGING, Scene

LIFTED = 1.0  # [N] below this weight the wheel hangs
COARSE = 0.02  # [s] grid of the vertical balance and of the first sweeps


class BedForm(Protocol):
    """A kind of bed. What a scene says of soil and rim holds on it, as far as it knows the word."""

    def carry(self, scenes: Sequence[Scene], weights: Sequence[Array], damped: bool) -> list[Scene]:
        """The scenes with all that the soil does under weights (n,) [N]: sinkage, θ₁, pressure,
        carried load, torque, pull, side. Undamped, the axle is in balance at every sample.
        """
        ...


@dataclass(frozen=True)
class EquationBed:
    """Eqs. (1)-(10) at every sample; the axle follows its balance with a lag."""

    def carry(self, scenes: Sequence[Scene], weights: Sequence[Array], damped: bool) -> list[Scene]:
        """See `BedForm.carry`; weights (n,) [N] of each scene."""
        return [
            _carried(scene, weight, damped) for scene, weight in zip(scenes, weights, strict=True)
        ]


def _carried(scene: Scene, weight: Array, damped: bool) -> Scene:
    down = weight > LIFTED
    # stresses take the mean radius, kinematics the true one
    mean, width = float(scene.radius.mean()), scene.rig.width
    depth = mean * (1.0 - np.cos(_balanced(scene, mean, np.maximum(weight, LIFTED))))
    if damped:
        depth = settled(depth, scene.moving, scene.motion.step, scene.rig.lag)

    theta_1 = np.where(down, np.arccos(np.clip(1.0 - depth / mean, 0.0, 1.0)), 1e-6)
    felt = reaction(scene.ground, scene.rim, mean, width, scene.ratio, theta_1)
    sign = scene.direction * scene.moving * down
    return replace(
        scene,
        theta_1=theta_1,
        sinkage=np.where(down, depth, HANGING),
        pressure=felt.pressure * down,
        carried=np.where(down, felt.load if damped else weight, 0.0),
        torque=felt.torque * sign,
        pull=felt.pull * sign,
        side=felt.side * sign,
    )


def _balanced(scene: Scene, radius: float, weight: Array) -> Array:
    """θ₁ (n,) at which the soil carries the weight, solved on a grid not finer than the axle can
    follow.
    """
    every = every_of(scene.motion.time, COARSE)
    time, width, ratio = scene.motion.time, scene.rig.width, scene.ratio[::every]
    ground, rim = thinned(scene.ground, every), thinned(scene.rim, every)

    known = scene.theta_1[::every] if scene.theta_1.size else np.zeros(ratio.size)
    guess = np.where(known > 0.01, known, 0.4)
    theta_1 = balance(
        lambda t: reaction(ground, rim, radius, width, ratio, t).load, weight[::every], guess
    )

    return np.interp(time, time[::every], theta_1)


def every_of(time: Array, step: float) -> int:
    """How many samples of times (n,) make a step [s]."""
    return max(1, round(step / float(time[1] - time[0])))
