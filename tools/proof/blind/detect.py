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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import cho_solve, solve_triangular, toeplitz

from gritd.tools.proof.blind import campaign
from gritd.tools.proof.blind.knowledge import Knowledge
from gritd.tools.proof.blind.plant.concealed import drawn
from gritd.tools.proof.blind.plant.contact import Ground
from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.respond import World, responses
from gritd.tools.proof.blind.plant.scene import Felt, Motion
from gritd.tools.proof.blind.plant.sensors import Chain, Converter
from gritd.tools.proof.blind.plant.servo import summed

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


Signals = list[dict[str, Array]]  # a dict of channels for every run, SI


class Detector:
    """What one campaign can see."""

    def __init__(self, trial: Trial) -> None:
        self._trial = trial
        self._motions = [_motion(run, trial) for run in trial.runs]
        bare = trial.world.with_effects()
        self._bare = responses([(bare, motion) for motion in self._motions], damped=False)
        self._roots = [_roots(trial, felt) for felt in self._bare]
        self._nuisance = [*self._soil(), *self._weights(), *self._calibration()]
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

    def detectability(self, effects: Sequence[Effect]) -> float:
        """D of these effects together."""
        return float(np.sqrt(max(self._left(self.change(effects)), 0.0)))

    def change(self, effects: Sequence[Effect]) -> Array:
        """What the effects change in all channels and runs, whitened (m,)."""
        return self._whitened(self._changes(effects))

    def beside(self, change: Array, rivals: Array) -> float:
        """D that is left of a change when rivals (m, k) may imitate it at any strength."""
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

    def refit_variance(self, effects: Sequence[Effect]) -> dict[str, float]:
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

        held = _held_out([motion.time.size for motion in self._motions])
        sums: dict[str, list[Array]] = {}

        for run, inside in held:
            covariance = self._covariance(columns, run, inside)
            for channel in self._roots[run]:
                rows = np.stack([column[run][channel] for column in columns], axis=1)[inside]
                sums.setdefault(channel, []).append(((rows @ covariance) * rows).sum(axis=1))

        return {channel: float(np.concatenate(parts).mean()) for channel, parts in sums.items()}

    # ---- parts -----------------------------------------------------------------------------------
    # --------------------

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

    def _strength(self, effects: Sequence[Effect], place: int) -> Signals:
        """Change for a strength as much larger as it is large: its prior is as wide as itself."""
        step = 0.05
        moved = list(effects)
        moved[place] = replace(effects[place], strength=effects[place].strength * (1.0 + step))
        return _scaled(_less(self._changes(moved), self._changes(effects)), 1.0 / step)

    def _left(self, change: Array) -> float:
        shadow = self._columns.T @ change
        return float(change @ change - shadow @ cho_solve((self._factor, True), shadow))

    def _changes(self, effects: Sequence[Effect]) -> Signals:
        """Read with the effects, less predicted without from the motion and load that were read."""
        world = self._trial.world.with_effects(*effects)
        near = [bare.scene for bare in self._bare]
        felt = responses([(world, motion) for motion in self._motions], False, near)
        return [
            {name: read[name] - expected[name] for name in read}
            for read, expected in zip(map(self._read, felt), self._expected(felt), strict=True)
        ]

    def _read(self, felt: Felt) -> dict[str, Array]:
        return channels(felt, self._trial.wrench)

    def _expected(self, felt: Sequence[Felt]) -> Signals:
        """What is predicted without the effects, by run."""
        world, near = self._trial.world.with_effects(), [bare.scene for bare in self._bare]
        told = [_told(one, self._trial) for one in felt]
        found = [self._read(one) for one in responses([(world, m) for m in told], False, near)]
        if self._trial.wrench:
            weights = [bare.load for bare in self._bare]  # not the load that was read
            found = [signals | {"load": load} for signals, load in zip(found, weights, strict=True)]
        return found

    def _whitened(self, signals: Signals) -> Array:
        return np.concatenate(
            [
                solve_triangular(roots[name], values, lower=True)
                for run, roots in zip(signals, self._roots, strict=True)
                for name, values in run.items()
            ]
        )

    def _soil(self) -> list[Signals]:
        """One sigma of each soil parameter."""
        ground = self._trial.world.ground
        moved = [
            replace(ground, **{name: float(getattr(ground, name)) + SMALL * stated.sigma})
            for name, stated in self._trial.known.soil.items()
        ]
        return [_scaled(self._moved(ground=other), 1.0 / SMALL) for other in moved]

    def _weights(self) -> list[Signals]:
        """One sigma of the weights, half of it alike in all runs, half each run's own; and of the
        carriage's travel.
        """
        half = self._trial.known.weight_share / np.sqrt(2.0)
        alike = _scaled(self._moved(heavier=SMALL * half), 1.0 / SMALL)
        carriage = self._trial.known.instruments["carriage_encoder"].scale
        faster = SMALL * carriage.sigma / carriage.value
        return [alike, *_one_by_one(alike), _scaled(self._moved(faster=faster), 1.0 / SMALL)]

    def _moved(
        self, ground: Ground | None = None, heavier: float = 0.0, faster: float = 0.0
    ) -> Signals:
        """Change by another soil, heavier weights or a faster carriage, either by a share."""
        trial = self._trial
        world = replace(trial.world, ground=ground or trial.world.ground, effects=())
        told = [
            replace(m, weight=m.weight * (1.0 + heavier), speed=m.speed * (1.0 + faster))
            for m in self._motions
        ]
        near = [bare.scene for bare in self._bare]
        felt = responses([(world, motion) for motion in told], False, near)
        return _less([self._read(one) for one in felt], [self._read(bare) for bare in self._bare])

    def _calibration(self) -> list[Signals]:
        """One sigma of offset and gain of each channel, the torque constant's in the current's."""
        known, columns = self._trial.known, []
        for name in channels(self._bare[0], self._trial.wrench):
            said = known.instruments[INSTRUMENT[name]]
            gain = said.scale.sigma / abs(said.scale.value)
            if name == "current":
                gain = float(
                    np.hypot(gain, known.torque_constant.sigma / known.torque_constant.value)
                )
            columns += [self._only(name, said.offset.sigma, 0.0), self._only(name, 0.0, gain)]
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


def _less(one: Signals, other: Signals) -> Signals:
    return [{name: a[name] - b[name] for name in a} for a, b in zip(one, other, strict=True)]


def _scaled(signals: Signals, factor: float) -> Signals:
    return [{name: factor * values for name, values in run.items()} for run in signals]


def _one_by_one(signals: Signals) -> list[Signals]:
    """The change in one run alone, for every run."""
    return [
        _scaled_by(signals, [float(n == place) for n in range(len(signals))])
        for place in range(len(signals))
    ]


def _scaled_by(signals: Signals, factors: Sequence[float]) -> Signals:
    return [_scaled([run], factor)[0] for run, factor in zip(signals, factors, strict=True)]


def _held_out(sizes: Sequence[int]) -> list[tuple[int, Array]]:
    """What is held out in turn: a run and a mask (n,) of its samples. Whole runs, or thirds of a
    single one.
    """
    if len(sizes) > 1:
        return [(run, np.ones(size, dtype=bool)) for run, size in enumerate(sizes)]
    third = np.arange(sizes[0]) * 3 // sizes[0]
    return [(0, third == part) for part in range(3)]


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
    return (
        found | {"pull": felt.pull, "load": felt.load, "torque": felt.torque} if wrench else found
    )


def _told(felt: Felt, trial: Trial) -> Motion:
    """The motion and load that an engineer sees: the encoders' and the force sensor's."""
    motion = felt.scene.motion
    changed: dict[str, Any] = {}
    if felt.carriage is not motion.travel:
        unseen = np.gradient(felt.carriage - motion.travel, motion.step)
        changed |= {"travel": felt.carriage, "speed": motion.speed + unseen}
    if trial.wrench and not np.array_equal(felt.load, motion.weight):
        changed["weight"] = felt.load
    return replace(motion, **changed) if changed else motion


def _motion(run: campaign.Run, trial: Trial) -> Motion:
    orders = campaign.orders(run, trial.known.radius, RATE)
    step = 1.0 / RATE
    turn, travel = summed(orders.omega, step), orders.start + summed(orders.speed, step)
    return Motion(
        orders.time, turn, orders.omega, travel, orders.speed, orders.weight, orders.passes
    )


def _roots(trial: Trial, felt: Felt) -> dict[str, Array]:
    """Cholesky factor of each channel's noise covariance at RATE, in SI (n, n)."""
    converters = {c.channel: c for c in (*trial.chain.converters, *(trial.chain.wrench or ()))}
    read = channels(felt, trial.wrench)
    sizes = {name: float(np.sqrt(np.mean(values**2))) for name, values in read.items()}
    return {
        name: _root(converters[INSTRUMENT[name]], values.size, sizes[name])
        for name, values in read.items()
    }


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


def strengthened(detector: Detector, effect: Effect, wanted: float) -> tuple[Effect, float]:
    """The effect at the strength where its D is as wanted, and that D; at the largest strength
    where D stays below.
    """
    found = detector.detectability([effect])
    if found <= wanted:
        return effect, found
    for _ in range(6):
        effect = replace(effect, strength=effect.strength * min(wanted / max(found, 1e-9), 3.0))
        found = detector.detectability([effect])
        if abs(found / wanted - 1.0) < 0.05:
            break
    return effect, found
