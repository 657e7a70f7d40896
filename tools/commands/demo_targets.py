"""What a recording says against the truth and against the targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config.configuration import loads
from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.offline.playback import recorded_ticks
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.progress import Progress
from gritd.tools.testbed.plant import PlantKind
from gritd.tools.testbed.rig_config import LINEARISATION

TARGETS: dict[PlantKind, dict[str, float]] = {  # largest relative error
    "linear": {"cohesion": 0.05, "tan_phi": 0.02},
    "original": {"cohesion": 0.10, "tan_phi": 0.03},
}
SIGMAS = 2.0
FULL_RUN = 55.0  # [s] a shorter run is not held to the targets: it has seen too little
SHOWN = {
    "cohesion": ("c", "Pa", 1.0, 1),
    "tan_phi": ("tan φ", "", 1.0, 4),
    "shear_modulus": ("k", "mm", 1e3, 2),
}
NS = 1_000_000_000


@dataclass(frozen=True)
class EstimatedParameter:
    """One estimated soil parameter at the end of the run, SI."""

    name: str
    value: float
    sigma: float
    truth: float
    allowed: float | None  # relative; None where there is no target

    @property
    def relative(self) -> float:
        return self.value / self.truth - 1.0

    @property
    def in_sigmas(self) -> float:
        return (self.value - self.truth) / self.sigma

    @property
    def shortcomings(self) -> list[str]:
        """Targets missed, in words."""
        if self.allowed is None:
            return []
        symbol = SHOWN[self.name][0]
        missed = []
        if not abs(self.relative) <= self.allowed:
            missed.append(f"{symbol} is {self.relative:+.1%} off, allowed {self.allowed:.0%}")
        if not abs(self.in_sigmas) <= SIGMAS:
            missed.append(f"{symbol} is {self.in_sigmas:+.1f} σ off, allowed {SIGMAS:g} σ")
        return missed


def judge(ticks: Rows, truth: Mapping[str, float], plant: PlantKind) -> list[EstimatedParameter]:
    """The last tick against the truth. ticks: /tick (n,)."""
    full = (ticks["stamp"][-1] - ticks["stamp"][0]) / NS >= FULL_RUN
    last = dict(zip(ticks.dtype.names or (), ticks[-1].tolist(), strict=True))
    return _estimates(last, truth, TARGETS[plant] if full else {})


def _estimates(
    last: Mapping[str, float], truth: Mapping[str, float], targets: Mapping[str, float]
) -> list[EstimatedParameter]:
    return [
        EstimatedParameter(name, last[name], last[f"{name}_sigma"], truth[name], targets.get(name))
        for name in SHOWN
    ]


def without_correction(recording: Recording, truth: Mapping[str, float]) -> list[str]:
    """What the paper's closed forms alone would have learned from the same readings; empty where
    they were used.
    """
    settings = loads(recording.config_yaml or "", str(recording.path)).settings
    corrections = [effect for effect in settings.effects if effect.name == LINEARISATION]
    if any(effect.parameters["share"].value == 0.0 for effect in corrections):
        return []

    others = [effect for effect in settings.effects if effect.name != LINEARISATION]
    triangles = ConfiguredEffect(LINEARISATION, {"share": Uncertain(0.0)})
    pipeline = Pipeline(replace(settings, effects=(*others, triangles)), "plain")
    state, tick = pipeline.start(), None

    with Progress("once more without the correction", recording.counts["/tick"]) as progress:
        for recorded in recorded_ticks(recording, settings.rates.tick):
            state, tick = pipeline.step(state, recorded.readings, recorded.stamp)
            progress.advance()

    if tick is None:
        return []
    estimates = _estimates(dict(zip(TICK_NAMES, tick, strict=True)), truth, {})
    return [f"the same readings without {LINEARISATION}:", *table(estimates)[1:]]


def reasons(estimates: Sequence[EstimatedParameter]) -> list[str]:
    """Why the run falls short of its targets; empty if it does not."""
    return [reason for estimate in estimates for reason in estimate.shortcomings]


def praise(estimates: Sequence[EstimatedParameter]) -> str:
    """What is said where nothing fell short."""
    judged = any(estimate.allowed is not None for estimate in estimates)
    return (
        "all targets met" if judged else f"a run of less than {FULL_RUN:g} s is not held to targets"
    )


def table(estimates: Sequence[EstimatedParameter]) -> list[str]:
    """Estimate, truth, error and target, a line each."""
    lines = [f"{'':6}{'estimate ± σ':>22}{'truth':>12}{'error':>9}{'in σ':>8}   target"]

    for each in estimates:
        symbol, unit, factor, digits = SHOWN[each.name]
        value = f"{each.value * factor:.{digits}f} ± {each.sigma * factor:.{digits}f} {unit}"
        truth = f"{each.truth * factor:.{digits}f} {unit}"
        lines.append(
            f"{symbol:6}{value:>22}{truth:>12}{each.relative:>+9.1%}{each.in_sigmas:>+8.2f}   "
            f"{_target(each)}"
        )

    return lines


def _target(estimate: EstimatedParameter) -> str:
    if estimate.allowed is None:
        return "none"
    return (
        f"{estimate.allowed:.0%} and {SIGMAS:g} σ: {'missed' if estimate.shortcomings else 'met'}"
    )


def punctuality(loop: Rows) -> list[str]:
    """How late the ticks were. loop: /loop (n,)."""
    quantiles = np.quantile(loop["lateness"], (0.5, 0.99, 0.999, 1.0)) * 1e3
    took = np.quantile(loop["duration"], (0.5, 0.99)) * 1e3
    return [
        f"tick lateness {_listed(quantiles, ('50 %', '99 %', '99.9 %', 'max'))}",
        f"tick cost {_listed(took, ('50 %', '99 %'))}",
        f"ticks {len(loop)}, missed {int(loop['missed'][-1])}",
    ]


def _listed(times: Array, names: Sequence[str]) -> str:
    """Times [ms], shape (n,), each with its name behind it."""
    return ", ".join(f"{time:.3f} ms ({name})" for time, name in zip(times, names, strict=True))


def headline(estimates: Sequence[EstimatedParameter], plant: PlantKind, ticks: Rows) -> str:
    """The run in one line, for the figure. ticks: /tick (n,)."""
    seconds = (ticks["stamp"][-1] - ticks["stamp"][0]) / NS
    errors = ", ".join(
        f"{SHOWN[f.name][0]} {f.relative:+.1%} ({f.in_sigmas:+.1f} σ)" for f in estimates
    )
    return f"gritd demo, {plant} plant, {seconds:.0f} s on real wires: error of {errors}"
