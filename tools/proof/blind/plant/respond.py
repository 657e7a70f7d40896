"""The chain: motion in, what the sensors would read without noise out. Time samples at once, one
run at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.tools.proof.blind.plant.axle import balance, settled
from gritd.tools.proof.blind.plant.contact import Ground, reaction, thinned
from gritd.tools.proof.blind.plant.effect import Effect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import HANGING, Felt, Motion, Rig, Scene, scene_of
from gritd.tools.proof.blind.plant.servo import follow, summed

LIFTED = 1.0  # [N] below this weight the wheel hangs
ROUNDS = 2  # of path-dependent effects, which need the sinkage that depends on them
COARSE = 0.02  # [s] grid of the vertical balance and of the first sweeps
SERVO_STEP = 2e-3  # [s]
SWEEPS = 2  # of motion against soil; docs/proof.md states what a third changes


@dataclass(frozen=True)
class World:
    """The rig, the soil, and what acts beyond Eqs. (1)-(10)."""

    rig: Rig
    ground: Ground
    effects: tuple[Effect, ...] = ()


@dataclass(frozen=True)
class Orders:
    """What the controllers are told, arrays (n,) at a fixed step."""

    time: Array  # [s] since the campaign began
    omega: Array  # [rad/s]
    speed: Array  # [m/s]
    weight: Array  # [N]
    passes: int
    start: float  # [m] on the bed


def respond(world: World, motion: Motion, damped: bool = True, near: Array | None = None) -> Felt:
    """What is felt and read when the rig moves like this. Undamped, the axle is in balance at every
    sample.

    `near`: entry angles (n,) of a similar case, where the search for the balance starts.
    """
    scene = _scene(world, motion)
    if near is not None:
        scene = replace(scene, theta_1=near)
    for _ in range(ROUNDS if any(_path_dependent(e) for e in world.effects) else 1):
        scene = _contact(world, scene, damped)
    for effect in world.effects:
        scene = effect.forces(scene)
    return _sensed(world, scene)


def drive(world: World, orders: Orders) -> Felt:
    """The controllers drive the rig; motion and soil are solved in turns, first on a coarse grid."""
    coarse = _thinned(orders, _every(orders.time, COARSE))
    torque, pull = np.zeros(coarse.time.size), np.zeros(coarse.time.size)
    for _ in range(SWEEPS):
        felt = respond(world, _motion(world.rig, coarse, torque, pull))
        torque, pull = felt.motor_torque, felt.scene.pull
    fine = (np.interp(orders.time, coarse.time, values) for values in (torque, pull))
    return respond(world, _motion(world.rig, orders, *fine))


def _thinned(orders: Orders, every: int) -> Orders:
    kept = {name: getattr(orders, name)[::every] for name in ("time", "omega", "speed", "weight")}
    return replace(orders, **kept)


def _every(time: Array, step: float) -> int:
    return max(1, round(step / float(time[1] - time[0])))


def _motion(rig: Rig, orders: Orders, torque: Array, pull: Array) -> Motion:
    step = float(orders.time[1] - orders.time[0])
    substeps = max(1, round(step / SERVO_STEP))
    omega = follow(rig.wheel, orders.omega, torque, step, substeps)
    speed = follow(rig.carriage, orders.speed, -pull, step, substeps)
    travel = orders.start + summed(speed, step)
    return Motion(
        orders.time, summed(omega, step), omega, travel, speed, orders.weight, orders.passes
    )


def _path_dependent(effect: Effect) -> bool:
    return type(effect).carried is not Effect.carried


def _scene(world: World, motion: Motion) -> Scene:
    radius = np.full(motion.time.size, world.rig.radius)
    for effect in world.effects:
        radius = effect.radius(radius, motion)
    scene = scene_of(world.rig, world.ground, motion, radius)
    for effect in world.effects:
        scene = replace(scene, ground=effect.soil(scene.ground, scene))
    for effect in world.effects:
        scene = replace(scene, rim=effect.contact(scene.rim, scene))
    return scene


def _contact(world: World, scene: Scene, damped: bool) -> Scene:
    """Entry angle, sinkage and the soil's forces in the bed's frame."""
    weight = scene.motion.weight
    for effect in world.effects:
        weight = effect.carried(weight, scene)
    down = weight > LIFTED
    mean, width = (
        float(scene.radius.mean()),
        world.rig.width,
    )  # stresses take the mean radius, kinematics the true one
    depth = mean * (1.0 - np.cos(_balanced(scene, mean, np.maximum(weight, LIFTED))))
    if damped:
        depth = settled(depth, scene.moving, scene.motion.step, world.rig.lag)
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
    )


def _balanced(scene: Scene, radius: float, weight: Array) -> Array:
    """θ₁ (n,) at which the soil carries the weight, solved on a grid not finer than the axle can
    follow.
    """
    every = _every(scene.motion.time, COARSE)
    time, width, ratio = scene.motion.time, scene.rig.width, scene.ratio[::every]
    ground, rim = thinned(scene.ground, every), thinned(scene.rim, every)
    known = scene.theta_1[::every] if scene.theta_1.size else np.zeros(ratio.size)
    guess = np.where(known > 0.01, known, 0.4)
    theta_1 = balance(
        lambda t: reaction(ground, rim, radius, width, ratio, t).load, weight[::every], guess
    )
    return np.interp(time, time[::every], theta_1)


def _sensed(world: World, scene: Scene) -> Felt:
    loss = sum(
        (np.asarray(effect.loss(scene)) for effect in world.effects),
        start=np.zeros(scene.torque.size),
    )
    motor = scene.torque + loss + world.rig.wheel.inertia * scene.motion.alpha
    current = motor / world.rig.torque_constant
    for effect in world.effects:
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
    )
    for effect in world.effects:
        felt = effect.sensed(felt)
    return felt


def bare(world: World, effects: Sequence[Effect] = ()) -> World:
    """The same rig and soil with these effects in place of its own."""
    return replace(world, effects=tuple(effects))


__all__ = ["Orders", "World", "bare", "drive", "respond"]
