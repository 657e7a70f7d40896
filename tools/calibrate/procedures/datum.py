"""The wheel is lowered until it touches the surface, several times: the potentiometer's zero."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm, t

from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.calibrate.outcome import CalibratedKey, CalibrationOutcome
from gritd.tools.calibrate.sources import Signal, series, start_of
from gritd.tools.cli.command import DAMAGED, CommandError

SUMMARY = "touches of the surface: the potentiometer's zero"
POT, FORCE = Signal("sinkage_pot", "volts", "V"), Signal("wrench", "fz", "N")
FREE = 0.5  # [s] the wheel hangs free before a touch counts
BEFORE = 0.3  # [s] of lowering over which the height at the touch is found
FEW = 3  # touches under which their scatter says little


def touches(recorded: Recording, settings: Settings, contact: float) -> list[float]:
    """Volts of the potentiometer at each instant at which the load rises above `contact` [N], from
    the line through the readings before it. Raises CommandError.
    """
    assert settings.wrench is not None
    pot_time, pot, _ = series(recorded, POT)
    time, force, _ = series(recorded, FORCE)
    start = start_of(recorded, FORCE) - start_of(recorded, POT)
    known = settings.wrench.load
    load = force * known.scale.value + known.offset.value

    volts = [
        height
        for instant in _rises(time + start, load, contact)
        if (height := _at(pot_time, pot, instant)) is not None
    ]
    if not volts:
        raise CommandError(
            f"{recorded.path}: found no touch; expected the load to rise above {contact:g} N after "
            f"{FREE:g} s without it",
            DAMAGED,
        )
    return volts


def _rises(time: Array, load: Array, contact: float) -> list[float]:
    """Instants [s] at which a load rises above the contact force after hanging free."""
    rises, free_since = [], float(time[0])
    for before, now, weight in zip(time[:-1], time[1:], load[1:], strict=True):
        if weight < contact:
            continue
        if before - free_since >= FREE:
            rises.append(float(now))
        free_since = float(now)
    return rises


def _at(time: Array, volts: Array, instant: float) -> float | None:
    """The potentiometer at an instant, from the line through what came before; None with fewer than
    ten readings.
    """
    inside = (time >= instant - BEFORE) & (time <= instant)
    if inside.sum() < 10:
        return None
    return float(np.polyfit(time[inside] - instant, volts[inside], 1)[1])


def outcome(volts: Sequence[float], settings: Settings) -> CalibrationOutcome:
    """The offset that makes the mean of the touches zero."""
    scale = settings.channels["sinkage_pot"].calibration.scale.value
    heights = -scale * np.asarray(volts)
    noise = settings.channels["sinkage_pot"].noise * abs(scale)
    spread = float(heights.std(ddof=1)) if heights.size > 1 else noise
    sigma = max(spread * _few(heights.size), noise) / np.sqrt(heights.size)
    offset = Uncertain(float(heights.mean()), float(sigma))

    warnings = []
    if heights.size < FEW:
        warnings.append(
            f"{heights.size} touches say little of how they scatter; take {FEW} or more"
        )
    rows = [
        f"touch {number}: {v:.5g} V, {1e3 * (h - offset.value):+.3f} mm from the mean"
        for number, (v, h) in enumerate(zip(volts, heights, strict=True), start=1)
    ]
    datum = CalibratedKey(("channels", "sinkage_pot", "offset"), offset, "m", "mm")
    return CalibrationOutcome((datum,), ("channels", "sinkage_pot"), tuple(rows), tuple(warnings))


def _few(count: int) -> float:
    """By how much a scatter of few touches is raised, so that 2σ hold 95 %: Student's t."""
    return float(t.ppf(0.975, count - 1) / norm.ppf(0.975)) if count > 1 else 1.0
