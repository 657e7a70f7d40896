"""The chain: motion in, what the sensors would read without noise out. Time samples at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gritd.tools.proof.blind.plant.bed import COARSE, BedForm, EquationBed, every_of
from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.effect import PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene, TrueMotion, TrueRig, scene_of
from gritd.tools.proof.blind.plant.servo import follow, summed

ROUNDS = 2  # of path-dependent effects, which need the sinkage that depends on them
SERVO_STEP = 2e-3  # [s]
SWEEPS = 2  # of motion against soil; docs/trials.md states what a third changes


@dataclass(frozen=True)
class World:
    """The rig, the soil, and what acts beyond Eqs. (1)-(10)."""

    rig: TrueRig
    ground: PlantSoil
    effects: tuple[PlantEffect, ...] = ()  # concealed
    bed: BedForm = field(default_factory=EquationBed)
    baseline: tuple[PlantEffect, ...] = ()  # of the world itself: there in every campaign of it

    @property
    def acting(self) -> tuple[PlantEffect, ...]:
        return (*self.baseline, *self.effects)

    def with_effects(self, *effects: PlantEffect) -> World:
        """The same rig, bed and soil with these effects concealed."""
        return replace(self, effects=effects)


@dataclass(frozen=True)
class Commanded:
    """What the controllers are commanded, arrays (n,) at a fixed step."""

    time: Array  # [s] since the campaign began
    omega: Array  # [rad/s]
    speed: Array  # [m/s]
    weight: Array  # [N]
    passes: int
    start: float  # [m] on the bed


def respond(world: World, motion: TrueMotion, damped: bool = True) -> Felt:
    """What is felt and read when the rig moves like this."""
    return responses([(world, motion)], damped)[0]


def responses(
    asked: Sequence[tuple[World, TrueMotion]],
    damped: bool = True,
    near: Sequence[Scene | None] | None = None,
) -> list[Felt]:
    """What is felt and read in each world and motion; all worlds on one bed. Undamped, the axle is
    in balance at every sample.

    `near`: the scene of the same motion without concealed effects, where it is known. It is where
    the search for the balance starts, and it stands where the concealed effects do not meet the
    soil.
    """
    known = near or [None] * len(asked)
    scenes = [
        _met(world, motion, scene) for (world, motion), scene in zip(asked, known, strict=True)
    ]
    fresh = [place for place, scene in enumerate(scenes) if not scene.pull.size]
    worlds = [asked[place][0] for place in fresh]
    carried = _carry(worlds, [scenes[place] for place in fresh], damped)
    for place, scene in zip(fresh, carried, strict=True):
        scenes[place] = _forced(asked[place][0].baseline, scene)

    done = [_forced(world.effects, scene) for (world, _), scene in zip(asked, scenes, strict=True)]
    return [_sensed(world, scene) for (world, _), scene in zip(asked, done, strict=True)]


def drive(world: World, orders: Commanded) -> Felt:
    """The controllers drive the rig; motion and soil are solved in turns."""
    return drives(world, [orders])[0]


def drives(world: World, orders: Sequence[Commanded]) -> list[Felt]:
    """Several runs of one world, first on a coarse grid."""
    coarse = [_thinned(one, every_of(one.time, COARSE)) for one in orders]
    against = [(np.zeros(one.time.size), np.zeros(one.time.size)) for one in coarse]
    for _ in range(SWEEPS):
        felt = responses(
            [(world, _motion(world.rig, *each)) for each in zip(coarse, against, strict=True)]
        )
        against = [(one.motor_torque, one.scene.pull) for one in felt]

    motions = []
    for one, known, (torque, pull) in zip(orders, coarse, against, strict=True):
        fine = (np.interp(one.time, known.time, torque), np.interp(one.time, known.time, pull))
        motions.append(_motion(world.rig, one, fine))
    return responses([(world, motion) for motion in motions])


def _thinned(orders: Commanded, every: int) -> Commanded:
    kept = {name: getattr(orders, name)[::every] for name in ("time", "omega", "speed", "weight")}
    return replace(orders, **kept)


def _motion(rig: TrueRig, orders: Commanded, against: tuple[Array, Array]) -> TrueMotion:
    """How the rig moves while a torque [N·m] and a pull [N] hold it back."""
    torque, pull = against
    step = float(orders.time[1] - orders.time[0])
    substeps = max(1, round(step / SERVO_STEP))
    omega = follow(rig.wheel, orders.omega, torque, step, substeps)
    speed = follow(rig.carriage, orders.speed, -pull, step, substeps)
    travel = orders.start + summed(speed, step)
    return TrueMotion(
        orders.time, summed(omega, step), omega, travel, speed, orders.weight, orders.passes
    )


def _met(world: World, motion: TrueMotion, near: Scene | None) -> Scene:
    """The scene before the soil answers, or the one that is known where it must be the same."""
    if near is None:
        return _scene(world, motion)
    alike = motion is near.motion and world.ground is near.ground
    if alike and not any(effect.meets_soil() for effect in world.effects):
        return near
    return replace(_scene(world, motion), theta_1=near.theta_1)


def _scene(world: World, motion: TrueMotion) -> Scene:
    radius = np.full(motion.time.size, world.rig.radius)
    for effect in world.acting:
        radius = effect.radius(radius, motion)
    scene = scene_of(world.rig, world.ground, motion, radius)
    for effect in world.acting:
        scene = replace(scene, ground=effect.soil(scene.ground, scene))
    for effect in world.acting:
        scene = replace(scene, rim=effect.contact(scene.rim, scene))
    return scene


def _carry(worlds: Sequence[World], scenes: list[Scene], damped: bool) -> list[Scene]:
    """The soil's answers, in rounds where weights depend on the path."""
    if not worlds:
        return []
    rounds = ROUNDS if any(_path_dependent(e) for world in worlds for e in world.acting) else 1
    for _ in range(rounds):
        weights = [_weight(world, scene) for world, scene in zip(worlds, scenes, strict=True)]
        scenes = worlds[0].bed.carry(scenes, weights, damped)
    return scenes


def _path_dependent(effect: PlantEffect) -> bool:
    return type(effect).carried is not PlantEffect.carried


def _weight(world: World, scene: Scene) -> Array:
    weight = scene.motion.weight
    for effect in world.acting:
        weight = effect.carried(weight, scene)
    return weight


def _forced(effects: Sequence[PlantEffect], scene: Scene) -> Scene:
    for effect in effects:
        scene = effect.forces(scene)
    return scene


def _sensed(world: World, scene: Scene) -> Felt:
    loss = sum(
        (np.asarray(effect.loss(scene)) for effect in world.acting),
        start=np.zeros(scene.torque.size),
    )

    motor = scene.torque + loss + world.rig.wheel.inertia * scene.motion.alpha
    current = motor / world.rig.torque_constant
    for effect in world.acting:
        current = effect.drawn_current(current, scene)

    felt = Felt(
        scene,
        motor,
        scene.sinkage,
        current,
        scene.pull,
        scene.carried,
        scene.torque,
        scene.motion.travel,
        scene.side,
    )

    for effect in world.acting:
        felt = effect.sensed(felt)
    return felt


__all__ = ["Commanded", "World", "drive", "drives", "respond", "responses"]
