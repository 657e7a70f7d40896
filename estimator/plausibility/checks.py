"""What physics or the configuration forbids in a run.

Numbers: soil mechanics gives the bounds; TOLERANCE is how far the forces of published rigs stray
from what was stated (loads by 10 %, the radius of a wheel with lugs by another 10 %).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.model.balance import bekker_entry_angle
from gritd.estimator.offline.windows import Bools
from gritd.estimator.plausibility.driven import Course, Driven
from gritd.estimator.plausibility.mistakes import Sources, remedies, turned
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel
from gritd.estimator.wheel.window_choice import LENGTHS

GRAVITY = 9.80665  # [m/s²]
TOLERANCE = 0.25  # of a force
SLOWEST = 3e-4  # [m/s] of a rim: a wheel of the size of a hand needs half an hour for a turn
LONGEST = 2.0  # [s] between two readings: five fill the longest window of the filter
USUAL = (1e-4, 1.0)  # [s] between the readings of a log
BRAKED, SPINNING = -0.5, 0.85  # slip while driving beyond which a unit is asked after
RATIO = (0.02, 1.2)  # v / rω of a wheel that drives
MOST, FEW = 0.9, 0.05  # shares of the windows
BEARING = (
    1.0 / 30.0
)  # sinkage over what the stated soil lets expect: half way, in powers, to 1/1000
LEAST = 5  # windows that tell of a run


class Contradiction(NamedTuple):
    """kind: the same of all runs in which the same is amiss; alone: whether one run is enough, else
    all of a campaign have to show it.
    """

    kind: str
    text: str
    alone: bool = True


Check = Callable[[Driven, Settings, Sources], Iterator[Contradiction]]


def contradictions(run: Driven, settings: Settings, sources: Sources) -> tuple[Contradiction, ...]:
    """What cannot be, each with the likeliest remedy. What follows from another is not told."""
    clock = _found((_clock, _wrap), run, settings, sources)
    motion = _found((_slip,), run, settings, sources) or _found((_speed,), run, settings, sources)
    placed = _found((_sinkage, _load), run, settings, sources)
    forces = () if motion or placed else _found((_torque, _pull), run, settings, sources)
    return (*clock, *motion, *placed, *forces)


def _found(
    checks: Iterable[Check], run: Driven, settings: Settings, sources: Sources
) -> tuple[Contradiction, ...]:
    return tuple(chain.from_iterable(check(run, settings, sources) for check in checks))


def _told(kind: str, fact: str, likely: list[str]) -> Contradiction:
    remedy = " or ".join(likely[:3])
    return Contradiction(f"{kind}: {remedy}", f"{fact}: {remedy}" if likely else fact)


# --- time and motion ---


def _clock(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    clock = run.clock
    if clock.leap:
        yield _told(
            "leap",
            f"time jumps by {clock.leap:.4g} s after {clock.at:.4g} s, where rows are usually "
            f"{clock.interval:.3g} s apart, while the wheel turns",
            ["a wrong stamp or missing rows"],
        )
    if not 1.0 / 500.0 < clock.change < 500.0:
        yield _told(
            "unit of time",
            f"the time between two rows is {clock.change:.3g} times as long at the end as at the "
            "beginning: its unit changes",
            [],
        )

    short = 0.0 < clock.duration < run.window
    if clock.interval > LONGEST or short:
        fact = f"{clock.duration:.3g} s in steps of {clock.interval:.3g} s hold no window"
        yield _told("window", fact, _times(run, sources))


def _times(run: Driven, sources: Sources) -> list[str]:
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


def _rim(course: Course) -> float:
    """Usual speed of the rim [m/s]; 0 where it does not turn."""
    return float(np.median(np.abs(course.rim[course.driving]))) if course.count else 0.0


def _speed(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    """Above √(g r) soil is thrown, and no equation of statics holds."""
    rim, fastest = _rim(run.course), (GRAVITY * settings.wheel.radius) ** 0.5
    if run.course.count < LEAST or SLOWEST <= rim <= fastest or run.clock.interval > LONGEST:
        return
    likely = [] if "wheel" in sources and sources["wheel"].speed else _times(run, sources)
    likely = likely or [
        f"{remedy.words}, and the carriage likewise"
        for remedy in remedies("wheel", sources)
        if SLOWEST <= rim * remedy.factor <= fastest
    ]
    if rim > fastest:
        yield _told(
            "fast", f"the rim moves at {rim:.3g} m/s, beyond √(g r) = {fastest:.2g} m/s", likely
        )
    elif likely:
        yield _told("slow", f"the rim moves at {1e3 * rim:.3g} mm/s", likely)


def _wrap(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    if run.wrap:
        turns = run.wrap / (2.0 * np.pi)
        source = sources["wheel"]
        remedy = f"wraps: 360 deg for {source.name}" if source.channel else "its counter's width"
        yield _told(
            "wrap",
            f"the wheel's angle falls back by {turns:.3g} turns in one step",
            [f"it wraps; {remedy} puts it right"],
        )


def _slip(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    course = run.course
    known = course.driving & np.isfinite(course.travel)
    if np.count_nonzero(known) < LEAST:
        return

    rim, ratio = course.rim[known], course.travel[known] / course.rim[known]
    opposed = float(np.mean((ratio < 0.0) & (ratio > -1.0)))
    if opposed > 0.5:
        yield _told(
            "opposed",
            "wheel and carriage run against each other, slip outside ±1",
            [turned("carriage", sources), turned("wheel", sources)],
        )
        return
    if np.all(rim < 0.0):
        yield _told(
            "backward",
            "wheel and carriage run backward throughout, and the filter takes forward motion alone",
            [f"{turned('wheel', sources)}, and the carriage likewise"],
        )

    slip = float(np.median(course.slip[np.isfinite(course.slip)]))
    likely = _ratios(ratio, sources)
    if slip < BRAKED and _drives(course):
        yield _told("braked", f"slip is {slip:.2f} while the wheel drives", likely)
    elif slip > SPINNING and likely and sources["wheel"].unit and not _sheared(course, settings):
        yield _told("spinning", f"slip is {slip:.2f} throughout", likely)._replace(alone=False)


def _drives(course: Course) -> bool:
    """Whether torque or pull are those of a wheel that drives."""
    forces = [course.torque[course.driving], course.pull[course.driving]]
    known = [course.forward * float(np.nanmedian(f)) for f in forces if np.isfinite(f).any()]
    return any(value > 0.0 for value in known)


def _sheared(course: Course, settings: Settings) -> bool:
    """Whether the torque is that of soil which is sheared to its strength, as where a wheel spins:
    T/r ≥ tan φ W / (1 + tan φ sin θ), with its stresses at one angle θ.
    """
    load, radius = _load_of(course, settings), settings.wheel.radius
    shear = np.abs(course.torque[course.driving & np.isfinite(course.torque)]) / radius
    if not shear.size or load <= 0.0:
        return False
    sinkage = np.nan_to_num(course.sinkage[course.driving])
    angle = 0.5 * float(np.median(_entry_angle(settings.wheel, sinkage)))
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


# --- sinkage and load ---


def _sinkage(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    course, radius = run.course, settings.wheel.radius
    touching = course.driving & ~(course.load < settings.load.minimum)
    known = course.sinkage[touching & np.isfinite(course.sinkage)]
    if known.size < LEAST:
        return

    sinkage, expected = float(np.median(known)), _expected_sinkage(course, settings)
    shown = f"{1e3 * sinkage:.3g} mm"
    if abs(sinkage) > radius:
        likely = [
            r.words for r in remedies("sinkage", sources) if _usual(sinkage * r.factor, radius)
        ]
        yield _told(
            "deep", f"sinkage is {shown}, beyond the radius of {1e3 * radius:.3g} mm", likely
        )
    elif _highest(course) < -max(_datum(settings), FEW * radius):
        yield _told(
            "above", f"sinkage is {shown} while the wheel drives", [turned("sinkage", sources)]
        )
    elif 0.0 < sinkage < BEARING * expected:
        likely = [
            r.words for r in remedies("sinkage", sources) if _usual(sinkage * r.factor, radius)
        ]
        if likely:
            yield _told(
                "shallow",
                f"sinkage is {shown}; the stated soil gives {1e3 * expected:.2g} mm",
                likely,
            )


def _highest(course: Course) -> float:
    """The sinkage [m] that is hardly ever passed in the run: before it a wheel may hang."""
    return float(np.percentile(course.sinkage[np.isfinite(course.sinkage)], 100.0 * MOST))


def _usual(sinkage: float, radius: float) -> bool:
    return FEW * radius < abs(sinkage) < radius


def _datum(settings: Settings) -> float:
    """How far the zero of the sinkage may be off [m]."""
    channel = settings.channels.get("sinkage_pot")
    return 4.0 * channel.calibration.offset.sigma if channel else 0.0


def _expected_sinkage(course: Course, settings: Settings) -> float:
    """By the stated soil under the load [m]."""
    soil, wheel = settings.soil, settings.wheel
    load = _load_of(course, settings)
    stated = Soil(
        soil.cohesion.value,
        soil.tan_phi.value,
        soil.shear_modulus.value,
        soil.exponent.value,
        soil.pressure_sinkage.modulus(wheel.width),
    )
    angle = bekker_entry_angle(wheel, stated, np.array([load]))
    return float(wheel.radius * (1.0 - np.cos(angle[0])))


def _load_of(course: Course, settings: Settings) -> float:
    """Usual size of the load [N] while driving."""
    load = course.load[course.driving & np.isfinite(course.load)]
    return abs(float(np.median(load))) if load.size else settings.load.nominal.value


def _load(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    load = run.course.load[run.course.driving]
    load = load[np.isfinite(load)]
    if load.size < LEAST:
        return

    low, usual, high = np.percentile(load, (5.0, 50.0, 95.0))
    if usual < -settings.load.minimum:
        yield _told(
            "negative load", f"load is {usual:.3g} N, and no soil pulls", [turned("load", sources)]
        )
        return
    stated = run.stated_load
    if stated is None or low / (1.0 + TOLERANCE) <= stated <= high * (1.0 + TOLERANCE):
        return
    likely = [
        remedy.words
        for remedy in remedies("load", sources)
        if abs(usual * remedy.factor / stated - 1.0) < TOLERANCE
    ]
    yield _told(
        "stated load", f"load is {usual:.3g} N as measured and {stated:.3g} N as stated", likely
    )


# --- torque and pull ---


def _torque(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    """Where slip is positive, soil is sheared backward all along the contact (Eq. 6): T > 0."""
    course = run.course
    torque, slip = course.forward * course.torque[course.driving], course.slip
    known = np.isfinite(torque) & (slip > FEW)
    if np.count_nonzero(known) < LEAST:
        return
    if float(np.mean(torque[known] < 0.0)) > MOST:
        usual = float(np.median(torque[known]))
        yield _told(
            "torque",
            f"torque is {usual:.3g} N·m against the motion of a wheel that slips forward",
            [turned("torque", sources)],
        )


def _pull(run: Driven, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    course, load = run.course, _load_of(run.course, settings)
    known = course.driving & np.isfinite(course.torque + course.pull)
    known[course.driving] &= course.slip > 0.0
    torque, pull = (course.forward * x[known] for x in (course.torque, course.pull))
    if pull.size < LEAST or float(np.median(torque)) <= 0.0 or load <= settings.load.minimum:
        return

    shear = torque / settings.wheel.radius
    least, most = _bounds(course, known, settings, shear)
    given = course.load[known], course.sinkage[known]
    rises = _rise(pull, shear, *given[:1]) or _rise(pull, shear, *given)
    if rises < 0.0:
        fact = f"pull changes by {rises:.2f} of torque over radius, and must rise with it"
        yield _told("falling pull", fact, [turned("pull", sources)])
    elif off := _outside(pull, least, most, load):
        likely = [
            remedy.words
            for remedy in remedies("pull", sources)
            if not _outside(pull * remedy.factor, least, most, load)
        ]
        turning = _outside(-pull, least, most, load) < 0.5 * off
        likely = [turned("pull", sources)] if turning else likely
        yield _told(
            "pull",
            f"pull is {np.median(pull):.3g} N, where torque over radius allows "
            f"{np.median(least):.3g} to {np.median(most):.3g} N",
            likely or ["the torque, its constant, or the radius is another"],
        )


def _rise(pull: Array, shear: Array, *given: Array) -> float:
    """By how much the pull (n,) rises with torque over radius (n,), other things (n,) being the
    same; 0 where that explains less than half of what is left of it. 1/cos θ, by `_bounds`.
    """
    given = tuple(x for x in given if np.all(np.isfinite(x)) and np.ptp(x) > 0.0)
    columns = np.column_stack([np.ones(pull.size), *given])
    left = [x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0] for x in (pull, shear)]
    together, squares = float(left[0] @ left[1]), [float(x @ x) for x in left]
    if together**2 <= 0.5 * squares[0] * squares[1]:
        return 0.0
    return together / squares[1]


def _bounds(course: Course, known: Bools, settings: Settings, shear: Array) -> tuple[Array, Array]:
    """Least and largest pull (m,) [N] of stresses that turn the wheel with this torque; shear:
    T/r (m,) [N].

    All stress at one angle θ gives DP = T/(r cos θ) − W tan θ, which falls with θ; the contact
    lies between 0 and θ₁. Eqs. (8)-(10) are sums of such.
    """
    wheel, load = settings.wheel, _load_of(course, settings)
    sinkage = course.sinkage[known] + 0.5 * _datum(settings)
    angle = _entry_angle(wheel, np.nan_to_num(sinkage, nan=wheel.radius))
    return shear / np.cos(angle) - load * np.tan(angle), shear


def _entry_angle(wheel: Wheel, sinkage: Array) -> Array:
    """θ₁ (n,) [rad], at most 80°."""
    angle: Array = np.arccos(np.clip(1.0 - sinkage / wheel.radius, np.cos(1.4), 1.0))
    return angle


def _outside(pull: Array, least: Array, most: Array, load: float) -> float:
    """How far most of the pulls (n,) lie outside their bounds, over the load; 0 within a
    tolerance.
    """
    off = np.maximum(least - pull, pull - most) / load
    worst = float(np.percentile(off, 100.0 * MOST))
    return worst if worst > 0.5 * TOLERANCE else 0.0
