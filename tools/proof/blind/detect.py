"""How visible a concealed effect is, by the plant itself: what it changes beyond what the soil can
imitate, in sigmas.

The plant predicts every channel with the effect and without it, on the motion that the encoders
tell. The difference is whitened at 5 Hz by the channels' own noise and by a floor of FLOOR of the
channel's size, correlated over FLOOR_TIME, below which nobody believes a model of soil. Soil
parameters, calibration constants and weights are then fitted to it (linearly, within their stated
sigma). What is left, as a root of squares over all samples, is the
detectability D: the effect costs a model that knows everything else D²/2 nats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import cho_solve

from gritd.tools.proof.blind import campaign
from gritd.tools.proof.blind.knowledge import Knowledge
from gritd.tools.proof.blind.plant.concealed import drawn
from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import World, responses
from gritd.tools.proof.blind.plant.scene import Felt, TrueMotion
from gritd.tools.proof.blind.plant.sensors import SensorChain
from gritd.tools.proof.blind.plant.servo import summed
from gritd.tools.proof.blind.whitening import (
    INSTRUMENT,
    RATE,
    Signals,
    channels,
    held_out,
    less,
    noise_roots,
    one_by_one,
    scaled,
    whitened,
)

SMALL = 0.02  # of a prior sigma: step of the differences
LIMIT = 5.0  # D at the detection limit: five sigma
NEAR = 3.0  # two effects that differ by less than this D cannot be distinguished in a campaign
SHAPES = 3  # draws of a rival's shape that may imitate together


@dataclass(frozen=True)
class BlindTrial:
    """A campaign and all that is true of it but the effect."""

    world: World
    known: Knowledge
    chain: SensorChain
    runs: tuple[campaign.BlindRun, ...]
    # standard deviations [SI] of what is printed of it, by channel; none where it is recorded
    printed: Mapping[str, float] = field(default_factory=dict)

    @property
    def wrench(self) -> bool:
        return self.chain.wrench is not None


class Detector:
    """What one campaign can see."""

    def __init__(self, trial: BlindTrial) -> None:
        self._trial = trial
        self._motions = _motions(trial)
        self._bare = undisturbed(trial)
        self._roots = [noise_roots(trial.chain, felt) for felt in self._bare]
        self._own = self._misfit(())  # a leaking sensor misleads without concealed effects, too
        self._nuisance = [*self._soil_and_weights(), *self._calibration()]

        self._columns = np.stack([self._whitened(column) for column in self._nuisance], axis=1)
        self._factor = np.linalg.cholesky(
            self._columns.T @ self._columns + np.eye(self._columns.shape[1])
        )

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

    def detectability(self, effects: Sequence[PlantEffect]) -> float:
        """D of these effects together."""
        return float(np.sqrt(max(self._left(self.change(effects)), 0.0)))

    def change(self, effects: Sequence[PlantEffect]) -> Array:
        """What the effects change in all channels and runs, whitened (m,)."""
        return self._whitened(self._changes(effects))

    def beside(self, change: Array, rivals: Array) -> float:
        """D that is left of a change (m,) when rivals (m, k) may imitate it at any strength; both
        whitened.
        """
        projected = rivals - self._columns @ cho_solve(
            (self._factor, True), self._columns.T @ rivals
        )
        own, cross = rivals.T @ projected, projected.T @ change
        weak = 1e-9 * max(float(np.trace(own)), 1e-300)
        gain = cross @ np.linalg.solve(own + weak * np.eye(own.shape[0]), cross)
        return float(np.sqrt(max(self._left(change) - float(gain), 0.0)))

    def rivals(self, name: str, rng: np.random.Generator) -> Array:
        """Changes (m, k) by an effect in as many forms and shapes as it is granted, at a tenth of
        its largest strength.
        """
        facts = self.facts()
        made = [drawn(name, rng, facts) for _ in range(SHAPES)]
        return np.stack(
            [self.change([replace(e, strength=0.1 * e.strength)]) for e in made], axis=1
        )

    def refit_variance(self, effects: Sequence[PlantEffect]) -> dict[str, float]:
        """What fitting adds to the error of a held-out run [SI²], by channel, expected, to first
        order.

        The oracle knows the form of the effects. It fits their strengths, soil, weights and
        calibration to the other runs (to the other two thirds of a single one) within what is
        stated of them.
        """
        columns = [
            *self._nuisance,
            *(self._strength(effects, place) for place in range(len(effects))),
        ]
        held = held_out([motion.time.size for motion in self._motions])
        sums: dict[str, list[Array]] = {}

        for run, inside in held:
            covariance = self._covariance(columns, run, inside)
            for channel in self._roots[run]:
                rows = np.stack([column[run][channel] for column in columns], axis=1)[inside]
                sums.setdefault(channel, []).append(((rows @ covariance) * rows).sum(axis=1))

        return {channel: float(np.concatenate(parts).mean()) for channel, parts in sums.items()}

    def _covariance(self, columns: Sequence[Signals], run: int, inside: Array) -> Array:
        """Of the columns' amplitudes after a fit to everything but these samples of a run, unit
        priors.
        """
        kept = []
        for column in columns:
            rest = [dict(signals) for signals in column]
            rest[run] = {
                name: np.where(inside, 0.0, values) for name, values in column[run].items()
            }
            kept.append(self._whitened(rest))

        known = np.stack(kept, axis=1)
        return np.asarray(np.linalg.inv(known.T @ known + np.eye(known.shape[1])), dtype=float)

    def _strength(self, effects: Sequence[PlantEffect], place: int) -> Signals:
        """Change for a strength as much larger as it is large: its prior is as wide as itself."""
        step = 0.05
        moved = list(effects)
        moved[place] = replace(effects[place], strength=effects[place].strength * (1.0 + step))
        return scaled(less(self._changes(moved), self._changes(effects)), 1.0 / step)

    def _left(self, change: Array) -> float:
        shadow = self._columns.T @ change
        return float(change @ change - shadow @ cho_solve((self._factor, True), shadow))

    def _changes(self, effects: Sequence[PlantEffect]) -> Signals:
        """What the effects change in what is read beyond what is predicted."""
        return less(self._misfit(effects), self._own)

    def _misfit(self, effects: Sequence[PlantEffect]) -> Signals:
        """Read with the effects, less predicted without from the motion and load that were read."""
        world = self._trial.world.with_effects(*effects)
        near = [bare.scene for bare in self._bare]
        felt = responses([(world, motion) for motion in self._motions], False, near)
        return less([self._read(one) for one in felt], self._expected(felt))

    def _read(self, felt: Felt) -> dict[str, Array]:
        return channels(felt, self._trial.wrench)

    def _expected(self, felt: Sequence[Felt]) -> Signals:
        """What is predicted without the effects, by run."""
        world, near = self._trial.world.with_effects(), [bare.scene for bare in self._bare]
        seen = [_seen(one, self._trial) for one in felt]
        expected = [self._read(one) for one in responses([(world, m) for m in seen], False, near)]
        if self._trial.wrench:
            weights = [bare.load for bare in self._bare]  # not the load that was read
            expected = [
                signals | {"load": load} for signals, load in zip(expected, weights, strict=True)
            ]
        return expected

    def _whitened(self, signals: Signals) -> Array:
        return whitened(signals, self._roots)

    def _soil_and_weights(self) -> list[Signals]:
        """One sigma of each soil parameter; of the weights, half of it alike in all runs, half each
        run's own; and of the carriage's travel.
        """
        known, ground = self._trial.known, self._trial.world.ground
        soils = [
            replace(ground, **{name: float(getattr(ground, name)) + SMALL * stated.sigma})
            for name, stated in known.soil.items()
        ]

        half = known.weight_share / float(np.sqrt(2.0))
        carriage = known.instruments["carriage_encoder"].scale
        faster = carriage.sigma / carriage.value

        moved = [(soil, 0.0, 0.0) for soil in soils]
        moved += [(ground, SMALL * half, 0.0), (ground, 0.0, SMALL * faster)]
        *separate, alike, driven = (scaled(change, 1.0 / SMALL) for change in self._moved(moved))
        return [*separate, alike, *one_by_one(alike), driven]

    def _moved(self, variants: Sequence[tuple[PlantSoil, float, float]]) -> list[Signals]:
        """Changes by another soil, heavier weights or a faster carriage, either by a share."""
        asked = [
            (replace(self._trial.world, ground=ground, effects=()), _faster(m, heavier, faster))
            for ground, heavier, faster in variants
            for m in self._motions
        ]
        near = [bare.scene for bare in self._bare] * len(variants)
        felt = [self._read(one) for one in responses(asked, False, near)]
        bare, runs = [self._read(one) for one in self._bare], len(self._motions)
        return [less(felt[k : k + runs], bare) for k in range(0, len(felt), runs)]

    def _calibration(self) -> list[Signals]:
        """One sigma of offset and gain of each channel, the torque constant's in the current's."""
        known, columns = self._trial.known, []
        for name in channels(self._bare[0], self._trial.wrench):
            instrument = known.instruments[INSTRUMENT[name]]
            gain = instrument.scale.sigma / abs(instrument.scale.value)
            if name == "current":
                gain = float(
                    np.hypot(gain, known.torque_constant.sigma / known.torque_constant.value)
                )
            columns += [self._only(name, instrument.offset.sigma, 0.0), self._only(name, 0.0, gain)]

        return columns

    def _only(self, channel: str, offset: float, gain: float) -> Signals:
        """Change of one channel's calibration alone."""
        read = [channels(bare, self._trial.wrench) for bare in self._bare]
        return [
            {
                name: offset + gain * values if name == channel else np.zeros(values.size)
                for name, values in run.items()
            }
            for run in read
        ]


def undisturbed(trial: BlindTrial) -> list[Felt]:
    """What each run would feel without the concealed effects, at RATE."""
    bare = trial.world.with_effects()
    return responses([(bare, motion) for motion in _motions(trial)], damped=False)


def _motions(trial: BlindTrial) -> list[TrueMotion]:
    return [_motion(run, trial) for run in trial.runs]


def _seen(felt: Felt, trial: BlindTrial) -> TrueMotion:
    """The motion and load that an engineer sees: the encoders' and the force sensor's."""
    motion = felt.scene.motion
    changed: dict[str, Any] = {}
    if felt.carriage is not motion.travel:
        unseen = np.gradient(felt.carriage - motion.travel, motion.step)
        changed |= {"travel": felt.carriage, "speed": motion.speed + unseen}
    if trial.wrench and not np.array_equal(felt.load, motion.weight):
        changed["weight"] = felt.load
    return replace(motion, **changed) if changed else motion


def _faster(motion: TrueMotion, heavier: float, faster: float) -> TrueMotion:
    """The same run with weights and travel larger by a share."""
    return replace(
        motion,
        weight=motion.weight * (1.0 + heavier),
        speed=motion.speed * (1.0 + faster),
        travel=motion.travel[0] + (motion.travel - motion.travel[0]) * (1.0 + faster),
    )


def _motion(run: campaign.BlindRun, trial: BlindTrial) -> TrueMotion:
    orders = campaign.orders(run, trial.known.radius, RATE)
    step = 1.0 / RATE
    turn, travel = summed(orders.omega, step), orders.start + summed(orders.speed, step)
    return TrueMotion(
        orders.time, turn, orders.omega, travel, orders.speed, orders.weight, orders.passes
    )


def strengthened(
    detector: Detector, effect: PlantEffect, wanted: float
) -> tuple[PlantEffect, float]:
    """The effect at the strength where its D is as wanted, and that D; at the largest strength
    where D stays below.
    """
    reached = detector.detectability([effect])
    if reached <= wanted:
        return effect, reached

    for _ in range(6):
        effect = replace(effect, strength=effect.strength * min(wanted / max(reached, 1e-9), 3.0))
        reached = detector.detectability([effect])
        if abs(reached / wanted - 1.0) < 0.05:
            break
    return effect, reached
