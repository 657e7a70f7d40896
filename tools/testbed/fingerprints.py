"""Where an effect shows: what it changes on a reference campaign, by channel and covariate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from gritd.estimator.effects.base import Effect, Parameter
from gritd.estimator.model.forward import Response, simulate_arrays
from gritd.estimator.offline.windows import group_means
from gritd.estimator.stages.history import rate_of
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel

WHEEL = Wheel(radius=0.072, width=0.071)
SOIL = Soil(
    cohesion=1000.0, tan_phi=0.577, shear_modulus=0.025, exponent=1.1, modulus=1.536e6
)  # dry sand
TORQUE_CONSTANT = 2.0  # [N·m/A]
NOISE = {
    "torque": 0.05,
    "drawbar_pull": 0.5,
    "sinkage": 2e-4,
    "load": 0.5,
}  # [N·m, N, m, N] what a channel can tell

LOADS, SLIPS, SPEEDS = (
    (35.0, 65.0, 95.0),
    (0.05, 0.2, 0.4, 0.6),
    (0.1, 0.25, 0.5),
)  # [N], [-], [rad/s]
RATE, SEGMENT, RAMP = 25.0, 4.0, 1.0  # [Hz, s, s]
RUNS = 4
BINS = 12
LEAST = 0.2  # [-] share below which a covariate explains nothing worth naming
TIE = 0.1  # [-] shares closer than this are no different
HIGHEST_ORDER = 60  # [cycles a turn] tried for the wheel angle


def campaign(runs: int = RUNS, seed: int = 3, reversing: bool = False) -> list[Motion]:
    """Runs that drive forward through all loads, slips and speeds in a drawn order, each run the
    next pass; reversing: forward and backward in turn.
    """
    rng = np.random.default_rng(seed)
    return [_run(rng, number, reversing) for number in range(runs)]


def _run(rng: np.random.Generator, number: int, reversing: bool) -> Motion:
    grid = [(load, slip, speed) for load in LOADS for slip in SLIPS for speed in SPEEDS]
    order = np.array([grid[i] for i in rng.permutation(len(grid))])
    if reversing:
        order[1::2, 2] *= -1.0

    time = np.arange(0.0, len(grid) * SEGMENT, 1.0 / RATE)
    load, slip, speed = (ramped(time, column) for column in order.T)
    travel = WHEEL.radius * speed * (1.0 - slip)

    return Motion(
        time=time + 180.0 * number,
        wheel_angle=np.cumsum(speed) / RATE,
        wheel_speed=speed,
        carriage_position=np.cumsum(travel) / RATE,
        carriage_speed=travel,
        load=load,
        pass_number=number + 1.0,
    )


def ramped(time: Array, levels: Array) -> Array:
    """Levels (m,) held for SEGMENT seconds each, joined by ramps of RAMP seconds; at times (n,)."""
    starts = SEGMENT * np.arange(len(levels))
    knots = np.stack((starts, starts + SEGMENT - RAMP)).T.ravel()
    return np.interp(time, knots, np.repeat(levels, 2))


def channels(response: Response) -> dict[str, Array]:
    """What the channels say of one run, each (n,); torque [N·m] is the motor's, from the current
    and the configured constant.
    """
    sensed = response.sensed
    return {
        "torque": np.asarray(TORQUE_CONSTANT * sensed.current),
        "drawbar_pull": np.asarray(sensed.drawbar_pull),
        "sinkage": np.asarray(sensed.sinkage),
        "load": np.asarray(sensed.load),
    }


def covariates(motions: list[Motion], plain: list[Response]) -> dict[str, Array]:
    """Every covariate of the campaign, (n,) each."""
    shape = [np.ones(np.shape(m.time)) for m in motions]

    return {
        "slip": np.concatenate([r.slip for r in plain]),
        "speed": np.concatenate(
            [m.wheel_speed * one for m, one in zip(motions, shape, strict=True)]
        ),
        "load": np.concatenate([m.load * one for m, one in zip(motions, shape, strict=True)]),
        "sinkage": np.concatenate([r.sinkage for r in plain]),
        "wheel_angle": np.concatenate([np.asarray(m.wheel_angle) for m in motions]),
        "position": np.concatenate([np.asarray(m.carriage_position) for m in motions]),
        "time": np.concatenate([np.asarray(m.time) for m in motions]),
        "acceleration": np.concatenate([rate_of(m.time, m.wheel_speed) for m in motions]),
        "reversal": np.concatenate([since_reversal(np.asarray(m.wheel_angle)) for m in motions]),
        "heat": np.concatenate([np.cumsum(r.current**2) / RATE for r in plain]),
        "run": np.concatenate([m.pass_number * one for m, one in zip(motions, shape, strict=True)]),
    }


def since_reversal(angle: Array) -> Array:
    """Angle turned since the way of turning last changed (n,) [rad], a stop included; positive
    forward. angle: of the wheel (n,) [rad].
    """
    way = np.sign(np.diff(angle, prepend=angle[:1]))
    reverses = np.diff(way, prepend=way[:1]) != 0.0
    last = np.maximum.accumulate(np.where(reverses, np.arange(angle.size) - 1, 0))
    since: Array = angle - angle[last]
    return since


@dataclass(frozen=True)
class EffectTrace:
    """What an effect changes: rms change over noise by channel, and the share of it each covariate
    explains.
    """

    change: dict[str, Array]  # by channel, (n,), in the channel's unit
    strength: dict[str, float]  # by channel, rms change over NOISE
    share: dict[str, dict[str, float]]  # by channel and covariate, 0 … 1
    covariates: dict[str, Array]

    def channel(self) -> str:
        """The channel that shows it most."""
        return max(self.strength, key=lambda channel: self.strength[channel])

    def stands_out(self, channel: str, covariate: str) -> bool:
        """Whether the covariate explains some, and no other clearly more; a constant must explain
        nearly all.
        """
        share = self.share[channel]
        if covariate == "constant":
            return share[covariate] > 0.95
        others = (value for name, value in share.items() if name != "constant")
        return share[covariate] > max(LEAST, max(others) - TIE)


def shown(effect: Effect) -> EffectTrace:
    """Run the campaign with and without the effect."""
    reversing = effect.fingerprint.covariate == "reversal"
    motions, plain = campaign(reversing=reversing), _plain(reversing)
    other = [
        simulate_arrays(WHEEL, SOIL, m, (effect,), torque_constant=TORQUE_CONSTANT) for m in motions
    ]

    before, after = ([channels(r) for r in responses] for responses in (plain, other))
    change = {
        c: np.concatenate([a[c] - b[c] for a, b in zip(after, before, strict=True)]) for c in NOISE
    }

    by = covariates(motions, plain)
    rate = {
        c: np.concatenate([rate_of(m.time, b[c]) for m, b in zip(motions, before, strict=True)])
        for c in NOISE
    }

    strength = {c: float(np.sqrt(np.mean(change[c] ** 2))) / NOISE[c] for c in NOISE}

    return EffectTrace(
        change, strength, {c: shares(change[c], {**by, "rate": rate[c]}) for c in NOISE}, by
    )


@cache
def _plain(reversing: bool) -> list[Response]:
    """The campaign without effects."""
    motions = campaign(reversing=reversing)
    return [simulate_arrays(WHEEL, SOIL, m, torque_constant=TORQUE_CONSTANT) for m in motions]


def shares(change: Array, by: dict[str, Array]) -> dict[str, float]:
    """Share of a change (n,) explained: `constant` by its mean, covariates (n,) beyond the mean."""
    total = float(np.mean(change**2))
    if total == 0.0:
        return dict.fromkeys(("constant", *by), 0.0)

    spread = max(float(np.var(change)), 1e-9 * total)
    explained = {
        name: _periodic(change, x) if name == "wheel_angle" else _binned(change, x)
        for name, x in by.items()
    }

    return {"constant": float(np.mean(change) ** 2) / total} | {
        n: s / spread for n, s in explained.items()
    }


def _binned(change: Array, covariate: Array) -> float:
    """Variance of the bin means, bins of equal count."""
    covariate = np.round(covariate, 6)  # a plateau is one bin, whatever its rounding error
    edges = np.unique(np.quantile(covariate, np.linspace(0.0, 1.0, BINS + 1)))
    bin_ = np.clip(np.searchsorted(edges, covariate, side="right") - 1, 0, max(len(edges) - 2, 0))
    means, count = group_means(bin_, change, BINS)
    filled = count > 0
    spread = count[filled] * (means[filled] - change.mean()) ** 2
    return float(np.sum(spread) / change.size)


def _periodic(change: Array, angle: Array) -> float:
    """Variance of the strongest whole order of the wheel angle."""
    orders = np.arange(1, HIGHEST_ORDER + 1)
    amplitude = np.exp(-1j * np.outer(orders, angle)) @ (change - change.mean()) / change.size
    return float(2.0 * np.max(np.abs(amplitude)) ** 2)


def typical(effect: type[Effect]) -> Effect:
    """The effect at the size to be expected."""
    return effect(**{p.name: typical_value(p) for p in effect.parameters()})


def typical_value(parameter: Parameter) -> float:
    return parameter.off + parameter.sigma if parameter.role == "strength" else parameter.centre
