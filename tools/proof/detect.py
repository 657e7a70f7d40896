"""How visible a concealed effect is, by the plant itself: what it changes beyond what the soil can imitate, in sigmas.

The plant predicts every channel with the effect and without it, on the motion that the encoders tell. The difference
is whitened at 5 Hz by the channels' own noise and by a floor of FLOOR of the channel's size, correlated over
FLOOR_TIME, below which nobody believes a model of soil. Soil parameters, calibration constants and weights are then
fitted to it (linearly, within their stated sigma). What is left, as a root of squares over all samples, is the
detectability D: the effect costs a model that knows everything else D²/2 nats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular, toeplitz

from tools.proof import campaign
from tools.proof.knowledge import Knowledge
from tools.proof.plant.contact import Ground
from tools.proof.plant.effect import Effect, Facts
from tools.proof.plant.quadrature import Array
from tools.proof.plant.respond import World, respond
from tools.proof.plant.scene import Felt, Motion
from tools.proof.plant.sensors import Chain, Converter
from tools.proof.plant.servo import summed

RATE = 5.0  # [Hz]
FLOOR, FLOOR_TIME = 0.003, 1.0  # of the channel's root mean square; [s]
SMALL = 0.02  # of a prior sigma: step of the differences
LIMIT = 5.0  # D at the detection limit: five sigma
NEAR = 3.0  # two effects that differ by less than this D cannot be told apart in a campaign
SHAPES = 3  # draws of a rival's shape that may imitate together


@dataclass(frozen=True)
class Trial:
    """A campaign and all that is true of it but the effect."""

    world: World
    known: Knowledge
    chain: Chain
    runs: tuple[campaign.Run, ...]

    @property
    def wrench(self) -> bool:
        return self.chain.wrench is not None


class Detector:
    """What one campaign can see."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self._motions = [_motion(run, trial) for run in trial.runs]
        bare = replace(trial.world, effects=())
        self._bare = [respond(bare, motion, damped=False) for motion in self._motions]
        self._roots = [_roots(trial, felt) for felt in self._bare]
        columns = np.stack([*self._soil_columns(), *self._calibration_columns()], axis=1)
        self._columns = columns
        self._factor = np.linalg.cholesky(columns.T @ columns + np.eye(columns.shape[1]))

    def facts(self) -> Facts:
        """Typical figures of the campaign."""
        felt, runs = self._bare, self._trial.runs
        driven = np.concatenate([(f.scene.moving > 0.9) & (f.scene.carried > 1.0) for f in felt])

        def typical(values: Sequence[Array]) -> float:
            return float(np.median(np.abs(np.concatenate(values))[driven]))

        return Facts(
            duration=float(np.mean([run.duration for run in runs])),
            length=float(max(np.max(np.abs(f.scene.motion.travel)) for f in felt)),
            radius=self._trial.world.rig.radius,
            weight=typical([f.scene.carried for f in felt]),
            omega=typical([f.scene.motion.omega for f in felt]),
            torque=typical([f.torque for f in felt]),
            current=typical([f.current for f in felt]),
            sinkage=typical([f.sinkage for f in felt]),
        )

    def detectability(self, effects: Sequence[Effect]) -> float:
        """D of these effects together."""
        return float(np.sqrt(max(self._left(self.change(effects)), 0.0)))

    def change(self, effects: Sequence[Effect]) -> Array:
        """What the effects change in all channels and runs, whitened (m,)."""
        world = replace(self._trial.world, effects=tuple(effects))
        parts = []
        for motion, bare, roots in zip(self._motions, self._bare, self._roots, strict=True):
            felt = respond(world, motion, damped=False)
            parts.append(self._whitened(self._misfit(felt, bare), roots))
        return np.concatenate(parts)

    def beside(self, change: Array, rivals: Array) -> float:
        """D that is left of a change when rivals (m, k) may imitate it at any strength."""
        projected = rivals - self._columns @ cho_solve((self._factor, True), self._columns.T @ rivals)
        own, cross = rivals.T @ projected, projected.T @ change
        weak = 1e-9 * max(float(np.trace(own)), 1e-300)
        gain = cross @ np.linalg.solve(own + weak * np.eye(own.shape[0]), cross)
        return float(np.sqrt(max(self._left(change) - float(gain), 0.0)))

    def rivals(self, effect: type[Effect], rng: np.random.Generator) -> Array:
        """Changes (m, k) by an effect in as many shapes as it is granted, at a tenth of its largest strength."""
        facts, count = self.facts(), SHAPES if len(fields(effect)) > 1 else 1
        drawn = [effect.drawn(rng, facts) for _ in range(count)]
        return np.stack([self.change([replace(e, strength=0.1 * e.strength)]) for e in drawn], axis=1)

    def _left(self, change: Array) -> float:
        shadow = self._columns.T @ change
        return float(change @ change - shadow @ cho_solve((self._factor, True), shadow))

    def _misfit(self, felt: Felt, bare: Felt) -> dict[str, Array]:
        """Read with the effect, less predicted without it from the motion and load that were read."""
        motion, trial = felt.scene.motion, self._trial
        told = _told(felt, motion, trial)
        same = told is motion
        predicted = bare if same else respond(replace(trial.world, effects=()), told, damped=False)
        read, expected = channels(felt, trial.wrench), channels(predicted, trial.wrench)
        if trial.wrench:
            expected["load"] = bare.load  # the weights, not the load that was read
        return {name: read[name] - expected[name] for name in read}

    @staticmethod
    def _whitened(misfit: dict[str, Array], roots: dict[str, Array]) -> Array:
        return np.concatenate([solve_triangular(roots[name], values, lower=True) for name, values in misfit.items()])

    def _soil_columns(self) -> list[Array]:
        ground, known = self._trial.world.ground, self._trial.known
        moved = []
        for name, stated in known.soil.items():
            value = float(getattr(ground, name))
            moved.append(self._column(replace(ground, **{name: value + SMALL * stated.sigma}), 0.0, 0.0) / SMALL)
        share = known.weight_sigma / max(run.weight for run in self._trial.runs)
        return [*moved, self._column(ground, SMALL * share, 0.0) / SMALL, self._column(ground, 0.0, 1e-4) / 0.2]

    def _column(self, ground: Ground, heavier: float, faster: float) -> Array:
        """Change by another soil, heavier weights or a faster carriage (relative)."""
        world = replace(self._trial.world, ground=ground, effects=())
        parts = []
        for motion, bare, roots in zip(self._motions, self._bare, self._roots, strict=True):
            moved = replace(motion, weight=motion.weight * (1.0 + heavier), speed=motion.speed * (1.0 + faster))
            felt, wrench = respond(world, moved, damped=False), self._trial.wrench
            read, expected = channels(felt, wrench), channels(bare, wrench)
            parts.append(self._whitened({name: read[name] - expected[name] for name in read}, roots))
        return np.concatenate(parts)

    def _calibration_columns(self) -> list[Array]:
        """Offset and gain of each channel, and the torque constant, at one sigma each."""
        known, columns = self._trial.known, []
        for name in channels(self._bare[0], self._trial.wrench):
            said = known.instruments[INSTRUMENT[name]]
            gain = said.scale.sigma / abs(said.scale.value)
            if name == "current":
                gain = float(np.hypot(gain, known.torque_constant.sigma / known.torque_constant.value))
            columns.append(self._only(name, said.offset.sigma, 0.0))
            columns.append(self._only(name, 0.0, gain))
        return columns

    def _only(self, channel: str, offset: float, gain: float) -> Array:
        """Change of one channel's calibration alone."""
        parts = []
        for bare, roots in zip(self._bare, self._roots, strict=True):
            read = channels(bare, self._trial.wrench)
            moved = {name: np.zeros(values.size) for name, values in read.items()}
            moved[channel] = offset + gain * read[channel]
            parts.append(self._whitened(moved, roots))
        return np.concatenate(parts)


INSTRUMENT = {
    "sinkage": "sinkage_pot",
    "current": "motor_shunt",
    "pull": "drawbar_pull",
    "load": "load",
    "torque": "torque",
}


def channels(felt: Felt, wrench: bool) -> dict[str, Array]:
    """Every analogue channel that the campaign records; a lifted wheel's sinkage says nothing."""
    down = felt.scene.motion.weight > 1.0
    found = {"sinkage": felt.sinkage * down, "current": felt.current}
    return found | {"pull": felt.pull, "load": felt.load, "torque": felt.torque} if wrench else found


def _told(felt: Felt, motion: Motion, trial: Trial) -> Motion:
    """The motion and load that an engineer sees: the encoders' and the force sensor's."""
    changed: dict[str, Any] = {}
    if felt.carriage is not motion.travel:
        changed |= {"travel": felt.carriage, "speed": np.gradient(felt.carriage, motion.step)}
    if trial.wrench and not np.array_equal(felt.load, motion.weight):
        changed["weight"] = felt.load
    return replace(motion, **changed) if changed else motion


def _motion(run: campaign.Run, trial: Trial) -> Motion:
    orders = campaign.orders(run, trial.known.radius, RATE)
    step = 1.0 / RATE
    turn, travel = summed(orders.omega, step), orders.start + summed(orders.speed, step)
    return Motion(orders.time, turn, orders.omega, travel, orders.speed, orders.weight, orders.passes)


def _roots(trial: Trial, felt: Felt) -> dict[str, Array]:
    """Cholesky factor of each channel's noise covariance at RATE, in SI (n, n)."""
    converters = {c.channel: c for c in (*trial.chain.converters, *(trial.chain.wrench or ()))}
    read = channels(felt, trial.wrench)
    sizes = {name: float(np.sqrt(np.mean(values**2))) for name, values in read.items()}
    return {name: _root(converters[INSTRUMENT[name]], values.size, sizes[name]) for name, values in read.items()}


def _root(converter: Converter, count: int, size: float) -> Array:
    noise, apart = converter.noise, np.arange(count) / RATE
    white = np.zeros(count)
    white[0] = (noise.white**2 + converter.quantum**2 / 12.0) * RATE / converter.rate
    times = (0.1 * noise.time, noise.time, 10.0 * noise.time) if noise.pink else (noise.time,)
    slow = sum((_mean_square(t) * np.exp(-apart / t) for t in times), start=np.zeros(count))
    own = abs(converter.scale) ** 2 * (white + noise.colour**2 / len(times) * slow)
    covariance = toeplitz(own + (FLOOR * size) ** 2 * np.exp(-apart / FLOOR_TIME))
    root: Array = np.linalg.cholesky(covariance + 1e-12 * covariance[0, 0] * np.eye(count))
    return root


def _mean_square(time: float) -> float:
    """Variance of the mean over one interval of unit noise with this correlation time [s]."""
    x = 1.0 / (RATE * time)
    return float(2.0 * (x - 1.0 + np.exp(-x)) / x**2)


def scaled(detector: Detector, effect: Effect, wanted: float) -> tuple[Effect, float]:
    """The effect at the strength where its D is as wanted, and that D; at the largest strength where D stays below."""
    found = detector.detectability([effect])
    if found <= wanted:
        return effect, found
    for _ in range(6):
        effect = replace(effect, strength=effect.strength * min(wanted / max(found, 1e-9), 3.0))
        found = detector.detectability([effect])
        if abs(found / wanted - 1.0) < 0.05:
            break
    return effect, found
