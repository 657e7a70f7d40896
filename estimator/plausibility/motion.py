"""What cannot be of a run's time and motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.plausibility.contradiction import (
    FEW,
    LEAST,
    MOST,
    Contradiction,
    contradiction,
    entry_angle,
    load_of,
)
from gritd.estimator.plausibility.driven import DrivenRun, RunWindows
from gritd.estimator.plausibility.mistakes import Sources, remedies, turned
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.wheel.window_choice import LENGTHS

GRAVITY = 9.80665  # [m/s²]
SLOWEST = 3e-4  # [m/s] of a rim: a wheel of the size of a hand needs half an hour for a turn
LONGEST = 2.0  # [s] between two readings: five fill the longest window of the filter
USUAL = (1e-4, 1.0)  # [s] between the readings of a log
CHANGE = 500.0  # times: two units of time differ by 1000
HELD = 0.25  # of the load: soil holds a wheel that skids back by more
BRAKED, SPINNING = -0.5, 0.85  # slip while driving beyond which a unit is asked after
RATIO = (0.02, 1.2)  # v / rω of a wheel that drives


def clock(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    own = run.clock
    if own.leap:
        yield contradiction(
            "leap",
            f"time jumps by {own.leap:.4g} s after {own.at:.4g} s, where rows are usually "
            f"{own.interval:.3g} s apart, while the wheel turns",
            ["a wrong stamp or missing rows"],
        )
    if not 1.0 / CHANGE < own.change < CHANGE:
        yield contradiction(
            "unit of time",
            f"the time between two rows is {own.change:.3g} times as long at the end as at the "
            "beginning: its unit changes",
            [],
        )

    short = 0.0 < own.duration < run.window
    if own.interval > LONGEST or short:
        fact = f"{own.duration:.3g} s in steps of {own.interval:.3g} s hold no window"
        yield contradiction("window", fact, _times(run, sources))


def _times(run: DrivenRun, sources: Sources) -> list[str]:
    """Units of time with which interval and speed are usual."""
    rim, speed = _rim(run.course), "wheel" in sources and sources["wheel"].speed
    low, high = USUAL
    return [
        remedy.words
        for remedy in remedies("time", sources)
        if low <= run.clock.interval * remedy.factor <= high
        and run.clock.duration * remedy.factor > LENGTHS[0]
        and (speed or not rim or rim / remedy.factor > SLOWEST)
    ]


def _rim(course: RunWindows) -> float:
    """Usual speed of the rim [m/s]; 0 where it does not turn."""
    return float(np.median(np.abs(course.rim[course.driving]))) if course.count else 0.0


def speed(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    """Above √(g r) soil is thrown, and no equation of statics holds."""
    rim, fastest = _rim(run.course), (GRAVITY * settings.wheel.radius) ** 0.5
    if run.course.count < LEAST or SLOWEST <= rim <= fastest or run.clock.interval > LONGEST:
        return
    if not np.isfinite(run.course.travel).any():  # a drive alone
        return
    likely = [] if "wheel" in sources and sources["wheel"].speed else _times(run, sources)
    if rim < SLOWEST:
        if likely:
            yield contradiction("slow", f"the rim moves at {1e3 * rim:.3g} mm/s", likely)
        return
    likely = likely or [
        f"{remedy.words}, and the carriage likewise"
        for remedy in remedies("wheel", sources)
        if SLOWEST <= rim * remedy.factor <= fastest
    ]
    yield contradiction(
        "fast", f"the rim moves at {rim:.3g} m/s, beyond √(g r) = {fastest:.2g} m/s", likely
    )


def hidden(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    """A wheel that turns one way in nearly all windows, in none of them faster than its noise."""
    rim = run.course.rim[np.isfinite(run.course.rim)]
    if run.course.count or rim.size < 2 * LEAST or abs(np.mean(np.sign(rim))) < MOST:
        return
    name = sources["wheel"].name if "wheel" in sources else "wheel"
    turns = f"the wheel turns at {1e3 * abs(np.median(rim)):.3g} mm/s of its rim"
    yield contradiction(
        "hidden",
        f"{turns}, less than 4σ of its noise",
        [f"look at {name} for jumps, or state its noise"],
    )


def wrap(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    if run.wrap:
        turns = run.wrap / (2.0 * np.pi)
        source = sources["wheel"]
        remedy = f"wraps: 360 deg for {source.name}" if source.channel else "its counter's width"
        yield contradiction(
            "wrap",
            f"the wheel's angle falls back by {turns:.3g} turns in one step",
            [f"it wraps; {remedy} puts it right"],
        )


def slip(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    course = run.course
    known = course.driving & np.isfinite(course.travel)
    if np.count_nonzero(known) < LEAST:
        return

    rim, ratio = course.rim[known], course.travel[known] / course.rim[known]
    opposed = float(np.mean((ratio < 0.0) & (ratio > -1.0)))
    if opposed > 0.5:
        yield contradiction(
            "opposed",
            "wheel and carriage run against each other, slip outside ±1",
            [turned("carriage", sources), turned("wheel", sources)],
        )
        return
    if np.all(rim < 0.0):
        yield contradiction(
            "backward",
            "wheel and carriage run backward throughout, and the filter takes forward motion alone",
            [f"{turned('wheel', sources)}, and the carriage likewise"],
        )

    slip = float(np.median(course.slip[np.isfinite(course.slip)]))
    likely = _ratios(ratio, sources)
    if slip < BRAKED and _drives(course, settings):
        yield contradiction("braked", f"slip is {slip:.2f} while the wheel drives", likely)
    elif slip > SPINNING and likely and sources["wheel"].unit and not _sheared(course, settings):
        yield contradiction("spinning", f"slip is {slip:.2f} throughout", likely)._replace(
            alone=False
        )


def _drives(course: RunWindows, settings: Settings) -> bool:
    """Whether torque or pull are those of a wheel that drives, in a tenth of the windows: one that
    skids takes no torque, and the soil holds it back.
    """
    load, radius = load_of(course, settings), settings.wheel.radius
    least = ((course.torque / radius, FEW * load), (course.pull, -HELD * load))
    for force, above in least:
        driving = (course.way * force)[course.driving]
        known = driving[np.isfinite(driving)]
        if known.size and np.percentile(known, 100.0 * MOST) > above:
            return True
    return False


def _sheared(course: RunWindows, settings: Settings) -> bool:
    """Whether the torque is that of soil which is sheared to its strength, as where a wheel spins:
    T/r ≥ tan φ W / (1 + tan φ sin θ), with its stresses at one angle θ.
    """
    load, radius = load_of(course, settings), settings.wheel.radius
    shear = np.abs(course.torque[course.driving & np.isfinite(course.torque)]) / radius
    if not shear.size or load <= 0.0:
        return False
    sinkage = np.nan_to_num(course.sinkage[course.driving])
    angle = 0.5 * float(np.median(entry_angle(settings.wheel, sinkage)))
    tan_phi = settings.soil.tan_phi.value
    least = load * tan_phi / (1.0 + tan_phi * float(np.sin(angle)))
    return float(np.percentile(shear, 5.0)) > least


def _ratios(ratio: Array, sources: Sources) -> list[str]:
    """Units with which carriage over rim (n,) is that of a wheel that drives."""

    def drives(changed: Array) -> bool:
        low, high = RATIO
        inside = np.mean((changed >= low) & (changed <= high))
        return bool(inside >= MOST and np.median(changed) > 1.0 - SPINNING)

    wheel = [r.words for r in remedies("wheel", sources) if drives(ratio / r.factor)]
    return wheel + [r.words for r in remedies("carriage", sources) if drives(ratio * r.factor)]
