"""The adapter for a wheel in soil: recordings and configuration in, channels predicted by the
forward model out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Calibration, Settings, Uncertain
from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.history import rate_of
from gritd.estimator.stages.situation import Motion, situation_of
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.rig.campaign import ORDER, Campaign, sensed_as
from gritd.tools.diagnose.rig.interface import Bools, Known, Run
from gritd.tools.diagnose.rig.proposals import proposed
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.states import at_rest, states
from gritd.tools.diagnose.rig.weight_sets import plates_of
from gritd.tools.diagnose.rig.weights import weights_of

HELD = 0.05  # of the driving torque: current at rest that differs by more holds something
EDGE = 2  # intervals at either end of a run where a slope lacks its neighbours
UNKNOWN = 1e5  # an offset less certain than this says that the channel was not measured
TIMING = 5e-3  # [s] by which a channel's stamps may be off
# second differences by which speeds, slopes over three intervals, cut corners that a channel does
# not
BLUR = 0.3
FLOORS = {
    "c": 0.05,
    "tan_phi": 0.02,
    "k": 0.03,
    "n": 0.01,
    "K": 0.02,
}  # least relative sigma
SCALE_FLOOR = 1e-3  # relative; no sensor's scale is known better
LEAST_WEIGHTS = 2e-3  # nor any weights
UNITS = {
    "torque": "N·m", "axle_torque": "N·m", "drawbar_pull": "N", "load": "N", "sinkage": "m", "slip": "-",
    "speed": "m/s", "wheel_angle": "rad", "position": "m", "time": "s", "acceleration": "rad/s²", "heat": "A²·s",
    "run": "-", "direction": "-", "constant": "-",
}  # fmt: skip
PHYSICS = (
    "c",
    "tan_phi",
    "k",
    "n",
    "K",
    "weights",
    "carriage_scale",
)  # what needs the forward model
OWN = 0.7  # share of a common error of the weights that each set of them may have for itself
KEPT = 4  # simulations of a run that are kept
LEFT_OUT = ("empirical_law",)  # stands for what has no name


class WheelRig:
    """See rig.Rig."""

    units: Mapping[str, str] = UNITS
    smooth = (
        ("slip",), ("speed",), ("load",), ("sinkage",), ("slip", "load"), ("slip", "speed"), ("slip", "sinkage"),
        ("speed", "load"), ("speed", "sinkage"), ("load", "sinkage"),
    )  # fmt: skip

    def __init__(self, signals: Sequence[Signals], settings: Settings) -> None:
        self.settings = settings
        self.caveats: list[str] = []
        self._weights = [weights_of(s, settings, self.caveats) for s in signals]
        self.channels = _channels(signals, settings, [w.known for w in self._weights])
        began = min(s.start for s in signals)
        self._motions = [
            _motion(s, w.values, settings, s.start - began)
            for s, w in zip(signals, self._weights, strict=True)
        ]
        self._plates = plates_of([np.asarray(m.load) for m in self._motions])
        self._plate = np.concatenate(self._plates.label)  # (N,)
        self.baseline = configured(settings.effects)
        self.constants = (
            *_soil(settings, self.caveats),
            *self._calibrations(),
            *_configured(settings),
        )
        out = {*LEFT_OUT, *(b.name for b in self.baseline)}
        if not all(w.known for w in self._weights):
            out.add(
                "load_axis_friction"
            )  # the measured load that drives the balance holds it already
        self.effects = {n: e for n, e in EFFECTS.items() if not e.filter_only and n not in out}
        self._campaign = Campaign(self._motions, settings, self.channels)
        self._kept: dict[tuple[object, ...], Array] = {}
        lengths = np.concatenate(
            [np.full(s.time.size, np.median(np.diff(s.time))) for s in signals]
        )
        self._step: Array = lengths  # [s] grid interval of each value (N,)
        self._inner = np.ones(
            lengths.size, bool
        )  # (N,) with a neighbour of the same run on either side
        for part in self._campaign.parts:
            self._inner[[part.start, part.stop - 1]] = False
        self._doubt = [s.doubt for s in signals]
        self.runs = self._without_held_torque([self._run(s, n) for n, s in enumerate(signals)])

    # ---- prediction ------------------------------------------------------------------------------
    # --------------------

    def predict(self, u: Array, effects: Sequence[Effect]) -> list[dict[str, Array]]:
        value = {known.name: known.of(float(x)) for known, x in zip(self.constants, u, strict=True)}
        read = self._read(self._true(value, (*self._baseline(value), *effects)), value)
        return [
            dict(zip(self.channels, read[:, part], strict=True)) for part in self._campaign.parts
        ]

    def _true(self, value: Mapping[str, float], effects: tuple[Effect, ...]) -> Array:
        """True readings (channels, N) before scale, offset and delay; the last few are kept."""
        own = (
            *(value[name] for name in self._plates.names),
            0.0,
        )  # the last for values without plates of their own
        physics = (*(value[name] for name in PHYSICS), *own, *effects)
        if physics not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            soil = Soil(value["c"], value["tan_phi"], value["k"], value["n"], value["K"])
            weights = 1.0 + value["weights"] + np.array(own)[self._plate]
            self._kept[physics] = self._campaign.readings(
                soil, weights, 1.0 + value["carriage_scale"], effects
            )
        return self._kept[physics]

    def _read(self, true: Array, value: Mapping[str, float]) -> Array:
        scale, offset, delay, blur = (
            np.array([value[f"{c}_{what}"] for c in self.channels])[:, None]
            for what in ("scale", "offset", "delay", "blur")
        )
        read = true * (1.0 + scale) + offset
        before, after = np.roll(read, 1, axis=1), np.roll(read, -1, axis=1)
        rate, bend = (after - before) / (2.0 * self._step), after + before - 2.0 * read
        return np.asarray(np.where(self._inner, read - delay * rate + blur * bend, read))

    def _baseline(self, value: Mapping[str, float]) -> tuple[Effect, ...]:
        return tuple(
            make(e.name, {p: value.get(f"{e.name}.{p}", q.value) for p, q in e.parameters.items()})
            for e in self.settings.effects
        )

    @property
    def _constant(self) -> float:
        return self.settings.drive.torque_constant.value

    def stated(self, unit: str) -> float:
        return 1.0

    @property
    def partial(self) -> Mapping[str, tuple[str, Sequence[Bools]]]:
        """What one set of weights is off by for itself does to its own values what a common error
        does to all.
        """
        return {
            name: ("weights", [label == number for label in self._plates.label])
            for number, name in enumerate(self._plates.names)
        }

    def _own_weight(self, load: float, common: float) -> float:
        """Relative standard deviation of one set of weights for itself: a plate's, or the load
        cell's at that load.
        """
        wrench = self.settings.wrench
        if wrench is None or all(w.known for w in self._weights):
            return OWN * common
        return float(np.hypot(OWN * common, wrench.load.offset.sigma / load))

    @cached_property
    def unsure(self) -> Sequence[Mapping[str, Array]]:
        """By the encoders' counts: slip is uncertain by what a carriage would make of it that is
        off by as much.
        """
        place = next(i for i, known in enumerate(self.constants) if known.name == "carriage_scale")
        u = np.zeros(len(self.constants))
        before = self.predict(u, ())
        u[place] = 1.0
        share = [doubt / self.constants[place].sigma for doubt in self._doubt]
        return [
            {c: np.abs(after[c] - was[c]) * s for c in self.channels}
            for was, after, s in zip(before, self.predict(u, ()), share, strict=True)
        ]

    def foresee(self, key: str, u: Array, effects: Sequence[Effect]) -> dict[str, Array]:
        """Channels under a proposed experiment (see proposals.py), for constants and effects as
        fitted.
        """
        value = {known.name: known.of(float(x)) for known, x in zip(self.constants, u, strict=True)}
        soil = Soil(value["c"], value["tan_phi"], value["k"], value["n"], value["K"])
        acting = (*self._baseline(value), *effects)
        motion = proposed(key, self._motions, self.settings.wheel.radius)
        sensed = simulate_arrays(
            self.settings.wheel, soil, motion, acting, torque_constant=self._constant, order=ORDER
        ).sensed
        return {
            c: sensed_as(sensed, c, self.settings) + value[f"{c}_offset"] for c in self.channels
        }

    # ---- what is known ---------------------------------------------------------------------------
    # --------------------

    def _calibrations(self) -> list[Known]:
        known = []
        for channel in self.channels:
            scale, offset = _calibration(self.settings, channel)
            unit = UNITS[channel]
            known += [
                Known(f"{channel}_scale", 0.0, max(scale, SCALE_FLOOR)),
                Known(f"{channel}_offset", 0.0, max(offset, 1e-9), unit),
                Known(f"{channel}_delay", 0.0, TIMING, "s"),
                Known(f"{channel}_blur", 0.0, BLUR),
            ]
        nominal = self.settings.load.nominal
        common = max(nominal.sigma / max(nominal.value, 1e-9), LEAST_WEIGHTS)
        known.append(Known("weights", 0.0, common))
        for name, load in zip(self._plates.names, self._plates.loads, strict=True):
            known.append(Known(name, 0.0, self._own_weight(load, common)))
        carriage = self.settings.channels["carriage_encoder"].calibration.scale
        known.append(
            Known("carriage_scale", 0.0, max(carriage.sigma / abs(carriage.value), SCALE_FLOOR))
        )
        return known

    def _run(self, signals: Signals, number: int) -> Run:
        motion = self._motions[number]
        measured = {c: _measured(signals, c, self._constant) for c in self.channels}
        covariates = self._covariates(signals, motion) | {"sinkage": self._depth(number)}
        driving, resting, lifted = states(motion, self.settings)
        still = {"torque": driving | resting | lifted}
        known = np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate)
        known[:EDGE] = known[-EDGE:] = False
        used = {c: known & still.get(c, driving) & np.isfinite(measured[c]) for c in self.channels}
        return Run(signals.name, np.asarray(motion.time), measured, used, covariates)

    def _without_held_torque(self, runs: list[Run]) -> list[Run]:
        """A servo may hold torque at rest: where the current at rest differs from rest to rest,
        rest says nothing.
        """
        if "torque" not in self.channels:
            return runs
        still = [run.used["torque"] & (run.covariates["speed"] == 0.0) for run in runs]
        means = [
            float(r.measured["torque"][m].mean())
            for r, m in zip(runs, still, strict=True)
            if m.any()
        ]
        driven = np.concatenate(
            [r.measured["torque"][r.used["torque"] & ~m] for r, m in zip(runs, still, strict=True)]
        )
        if (
            len(means) < 2
            or not driven.size
            or float(np.ptp(means)) < HELD * float(np.sqrt(np.mean(driven**2)))
        ):
            return runs
        self.caveats.append(
            "The motor holds torque while the wheel stands, so its current at rest tells no offset."
        )
        return [
            replace(run, used={**run.used, "torque": run.used["torque"] & ~mask})
            for run, mask in zip(runs, still, strict=True)
        ]

    def _depth(self, number: int) -> Array:
        """Sinkage predicted from the prior: the measured one carries the noise of its channel."""
        motion, prior = self._motions[number], {known.name: known.value for known in self.constants}
        soil = Soil(prior["c"], prior["tan_phi"], prior["k"], prior["n"], prior["K"])
        return simulate_arrays(
            self.settings.wheel, soil, motion, self.baseline, order=ORDER
        ).sinkage

    def _covariates(self, signals: Signals, motion: Motion) -> dict[str, Array]:
        situation = situation_of(motion, self.settings.wheel)
        current = _filled(signals.analogue.get("current", np.zeros(signals.time.size)))
        speed = self.settings.wheel.radius * np.abs(motion.wheel_speed)
        step = float(np.median(np.diff(signals.time)))
        ones = np.ones(signals.time.size)
        return {
            "slip": np.asarray(situation.slip),
            "speed": np.asarray(speed),
            "load": np.asarray(motion.load) * ones,
            "wheel_angle": np.asarray(motion.wheel_angle),
            "position": np.asarray(situation.position),
            "time": np.asarray(motion.time),
            "acceleration": rate_of(motion.time, motion.wheel_speed),
            "heat": np.cumsum(current**2) * step,
            "direction": np.asarray(situation.direction),
            "pass": motion.pass_number * ones,
            "constant": ones,
        }


def _channels(
    signals: Sequence[Signals], settings: Settings, weights_known: Sequence[bool]
) -> tuple[str, ...]:
    """Those that some recording has and that carry information."""
    source = {"torque": "current"}
    found = []
    for channel in ("torque", "axle_torque", "drawbar_pull", "sinkage", "load"):
        there = any(_varies(s.analogue.get(source.get(channel, channel))) for s in signals)
        if (
            there
            and _calibration(settings, channel)[1] < UNKNOWN
            and (channel != "load" or all(weights_known))
        ):
            found.append(channel)
    return tuple(found)


def _varies(values: Array | None) -> bool:
    return values is not None and bool(np.nanmax(values) > np.nanmin(values))


def _measured(signals: Signals, channel: str, constant: float) -> Array:
    nothing = np.full(signals.time.size, np.nan)
    if channel == "torque":
        return constant * signals.analogue.get("current", nothing)
    return signals.analogue.get(channel, nothing)


def _calibration(settings: Settings, channel: str) -> tuple[float, float]:
    """Relative sigma of the scale, sigma of the offset in the channel's unit."""
    if channel == "torque":
        shunt, constant = (
            settings.channels["motor_shunt"].calibration,
            settings.drive.torque_constant,
        )
        return float(
            np.hypot(_relative(shunt.scale), _relative(constant))
        ), constant.value * shunt.offset.sigma
    if channel == "sinkage":
        return _sigmas(settings.channels["sinkage_pot"].calibration)
    assert settings.wrench is not None
    return _sigmas(
        settings.wrench.torque if channel == "axle_torque" else getattr(settings.wrench, channel)
    )


def _sigmas(calibration: Calibration) -> tuple[float, float]:
    return _relative(calibration.scale), calibration.offset.sigma


def _relative(known: Uncertain) -> float:
    return known.sigma / abs(known.value) if known.value else 0.0


def _soil(settings: Settings, caveats: list[str]) -> tuple[Known, ...]:
    prior = settings.soil
    modulus = prior.pressure_sinkage.modulus(settings.wheel.width)
    stated = {
        "c": (prior.cohesion.value, prior.cohesion.sigma, "Pa"),
        "tan_phi": (prior.tan_phi.value, prior.tan_phi.sigma, "-"),
        "k": (prior.shear_modulus.value, prior.shear_modulus.sigma, "m"),
        "n": (prior.exponent.value, prior.exponent.sigma, "-"),
        "K": (modulus, modulus * prior.modulus_sigma, "Pa/m^n"),
    }
    raised = [name for name, (value, sigma, _) in stated.items() if sigma < FLOORS[name] * value]
    if raised:
        least = ", ".join(f"{name} {FLOORS[name]:.0%}" for name in raised)
        caveats.append(
            f"The configuration states {', '.join(raised)} as almost exact; they float within {least} instead."
        )
    low = {"c": 1.0, "tan_phi": 0.05, "n": 0.3}
    return tuple(
        Known(
            name,
            value,
            max(sigma, FLOORS[name] * value, 1e-12),
            unit,
            True,
            name in ("k", "K"),
            low.get(name, 0.0),
        )
        for name, (value, sigma, unit) in stated.items()
    )


def _configured(settings: Settings) -> tuple[Known, ...]:
    """Parameters of configured effects float within their own uncertainty, kept inside their
    bounds.
    """
    known = []
    for effect in settings.effects:
        for p in EFFECTS[effect.name].parameters():
            stated = effect.parameters.get(p.name)
            if stated is not None and stated.sigma > 0.0:
                known.append(
                    Known(
                        f"{effect.name}.{p.name}",
                        stated.value,
                        stated.sigma,
                        p.unit,
                        low=p.low,
                        high=p.high,
                    )
                )
    return tuple(known)


def _motion(signals: Signals, weights: Array, settings: Settings, began: float) -> Motion:
    angle, travel = (
        _filled(signals.wheel_angle),
        _filled(signals.carriage_angle) * settings.pulley_radius,
    )
    wheel_speed, carriage_speed = (
        _filled(signals.wheel_speed),
        _filled(signals.carriage_rate) * settings.pulley_radius,
    )
    rest = at_rest(settings.wheel.radius * wheel_speed, carriage_speed)
    temperature = signals.analogue.get("temperature")
    return Motion(
        time=signals.time + began,
        wheel_angle=angle,
        wheel_speed=np.where(rest, 0.0, wheel_speed),
        carriage_position=travel - travel[0],
        carriage_speed=np.where(rest, 0.0, carriage_speed),
        load=weights,
        pass_number=float(signals.info.pass_number),
        start_position=signals.info.start_position,
        temperature=None if temperature is None else _filled(temperature),
    )


def _filled(values: Array) -> Array:
    """NaN bridged by straight lines."""
    good = np.isfinite(values)
    at = np.arange(values.size)
    return np.interp(at, at[good], values[good]) if good.any() else np.zeros(values.size)
