"""What cannot be of a run's sinkage and forces.

Soil mechanics gives the bounds; TOLERANCE is how far the forces of published rigs stray from what
was stated (loads by 10 %, the radius of a wheel with lugs by another 10 %).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.model.balance import bekker_entry_angle
from gritd.estimator.offline.windows import Bools
from gritd.estimator.plausibility.contradiction import (
    FEW,
    LEAST,
    MOST,
    Contradiction,
    contradiction,
    datum,
    entry_angle,
    load_of,
)
from gritd.estimator.plausibility.driven import DrivenRun, RunWindows
from gritd.estimator.plausibility.mistakes import Sources, remedies, turned
from gritd.estimator.terramechanics.soil import Array, Soil

TOLERANCE = 0.25  # of a force
# sinkage over that of the stated soil: half way, in powers of ten, to 1/1000
BEARING = 1.0 / 30.0
PAIRED = 200  # windows of a run that are compared in pairs, and the least pairs that tell
CLEAR = 0.7  # share of pairs that fall less those that rise; of constant slip it is noise
SMALL = 0.5  # slip up to which the pull rises with it in every soil


def sinkage(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
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
        yield contradiction(
            "deep", f"sinkage is {shown}, beyond the radius of {1e3 * radius:.3g} mm", likely
        )
    elif _highest(course) < -max(datum(settings), FEW * radius):
        yield contradiction(
            "above", f"sinkage is {shown} while the wheel drives", [turned("sinkage", sources)]
        )
    elif 0.0 < sinkage < BEARING * expected:
        likely = [
            r.words for r in remedies("sinkage", sources) if _usual(sinkage * r.factor, radius)
        ]
        if likely:
            yield contradiction(
                "shallow",
                f"sinkage is {shown}; the stated soil gives {1e3 * expected:.2g} mm",
                likely,
            )


def _highest(course: RunWindows) -> float:
    """The sinkage [m] that is hardly ever passed in the run: before it a wheel may hang."""
    return float(np.percentile(course.sinkage[np.isfinite(course.sinkage)], 100.0 * MOST))


def _usual(sinkage: float, radius: float) -> bool:
    return FEW * radius < abs(sinkage) < radius


def _expected_sinkage(course: RunWindows, settings: Settings) -> float:
    """By the stated soil under the load [m]."""
    soil, wheel = settings.soil, settings.wheel
    load = load_of(course, settings)
    stated = Soil(
        soil.cohesion.value,
        soil.tan_phi.value,
        soil.shear_modulus.value,
        soil.exponent.value,
        soil.pressure_sinkage.modulus(wheel.width),
    )
    angle = bekker_entry_angle(wheel, stated, np.array([load]))
    return float(wheel.radius * (1.0 - np.cos(angle[0])))


def load(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    load = run.course.load[run.course.driving]
    load = load[np.isfinite(load)]
    if load.size < LEAST:
        return

    low, usual, high = np.percentile(load, (5.0, 50.0, 95.0))
    if usual < -settings.load.minimum:
        yield contradiction(
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
    yield contradiction(
        "stated load", f"load is {usual:.3g} N as measured and {stated:.3g} N as stated", likely
    )


def torque(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    """Where slip is positive, soil is sheared backward all along the contact (Eq. 6): T > 0."""
    course = run.course
    known = course.driving & np.isfinite(course.torque)
    known[course.driving] &= course.slip > FEW
    torque = (course.way * course.torque)[known]
    if torque.size < LEAST:
        return

    usual = float(np.median(torque))
    if float(np.mean(torque < 0.0)) > MOST:
        yield contradiction(
            "torque",
            f"torque is {usual:.3g} N·m against the motion of a wheel that slips forward",
            [turned("torque", sources)],
        )
        return
    yield from _strength(usual, course, known, settings, sources)


def _strength(
    usual: float, course: RunWindows, known: Bools, settings: Settings, sources: Sources
) -> Iterator[Contradiction]:
    """Soil takes c A + tan φ W / cos θ₁ at most, as its bounds are, and hardly a tenth of the least
    friction only where another unit is meant.
    """
    wheel, bounds = settings.wheel, settings.filter
    load = load_of(course, settings)
    if load <= settings.load.minimum:
        return
    sinkage = np.nan_to_num(course.sinkage[known], nan=wheel.radius)
    angle = float(np.median(entry_angle(wheel, sinkage)))
    area = wheel.width * wheel.radius * angle
    friction = bounds.tan_phi_bounds[1] * load / np.cos(angle)
    most = wheel.radius * (bounds.cohesion_bounds[1] * area + friction)
    least = bounds.tan_phi_bounds[0] * load * wheel.radius

    likely = [r.words for r in remedies("torque", sources) if least < usual * r.factor < most]
    if usual > (1.0 + TOLERANCE) * most:
        yield contradiction(
            "strength",
            f"torque is {usual:.3g} N·m, and soil within filter's bounds takes {most:.3g} N·m",
            likely or ["the torque, its constant, or the radius is another"],
        )
    elif 0.0 < usual < 0.1 * least and likely:
        yield contradiction("idle", f"torque is {usual:.2g} N·m under {load:.3g} N", likely)


def pull(run: DrivenRun, settings: Settings, sources: Sources) -> Iterator[Contradiction]:
    if load_of(run.course, settings) > settings.load.minimum:
        found = _falling(run.course, settings, sources) or _beyond(run.course, settings, sources)
        yield from [found] if found else []


def _falling(course: RunWindows, settings: Settings, sources: Sources) -> Contradiction | None:
    """The pull rises with the torque; where that is not known, with slip while it is small."""
    slip = np.full(course.pull.size, np.nan)
    slip[course.driving] = course.slip
    turning = bool(np.isfinite(course.torque).any())
    other = course.way * course.torque / settings.wheel.radius if turning else slip
    known = (slip > 0.0) & np.isfinite(course.pull + other) & (turning | (slip < SMALL))
    if np.count_nonzero(known) < LEAST or (turning and float(np.median(other[known])) <= 0.0):
        return None

    load = load_of(course, settings)
    pull, felt = (course.way * course.pull)[known], course.load[known]
    apart = FEW * load if turning else FEW
    together = _together(pull, other[known], np.nan_to_num(felt, nan=load), apart)
    if together > -CLEAR:
        return None
    what = "torque over radius" if turning else "slip"
    fact = f"pull falls where {what} rises under one load, in {50 - 50 * together:.0f} % of pairs"
    return contradiction("falling pull", fact, [turned("pull", sources)])


def _beyond(course: RunWindows, settings: Settings, sources: Sources) -> Contradiction | None:
    """The pull is that of stresses which turn the wheel with the measured torque."""
    known = course.driving & np.isfinite(course.torque + course.pull)
    known[course.driving] &= course.slip > 0.0
    torque, pull = ((course.way * x)[known] for x in (course.torque, course.pull))
    if pull.size < LEAST or float(np.median(torque)) <= 0.0:
        return None

    usual = load_of(course, settings)
    load = np.nan_to_num(course.load[known], nan=usual)
    least, most = _bounds(course, known, settings, torque / settings.wheel.radius, load)
    felt = np.maximum(load, usual)
    if not (off := _outside(pull, least, most, felt)):
        return None
    throughout = np.median(np.maximum(least - pull, pull - most)) > 0.0
    likely = [
        remedy.words
        for remedy in remedies("pull", sources)
        if throughout
        and not _outside(pull * remedy.factor, least, most, felt)
        and np.percentile(np.abs(pull * remedy.factor), 100.0 * MOST) > FEW * usual
    ]
    if _outside(-pull, least, most, felt) < 0.5 * off:
        likely = [turned("pull", sources)]
    low, high = float(np.median(least)), float(np.median(most))
    allowed = f"{low:.3g} to {high:.3g} N" if np.isfinite(low) else f"{high:.3g} N at most"
    return contradiction(
        "pull",
        f"pull is {np.median(pull):.3g} N, where torque over radius allows {allowed}",
        likely or ["a zero, the torque's constant, or the radius is another"],
    )


def _together(pull: Array, other: Array, load: Array, apart: float) -> float:
    """Whether the pull (n,) rises with another quantity (n,): the mean sign over pairs of windows
    under one load that are so far apart; 0 where there are too few.
    """
    some = np.unique(np.linspace(0, pull.size - 1, PAIRED).astype(np.int64))
    first, second = np.triu_indices(some.size, 1)
    rise, way, heavier = (x[some][second] - x[some][first] for x in (pull, other, load))
    pairs = (np.abs(way) > apart) & (np.abs(heavier) < FEW * np.median(load))
    if np.count_nonzero(pairs) < PAIRED:
        return 0.0
    return float(np.mean(np.sign(rise[pairs] * way[pairs])))


def _bounds(
    course: RunWindows, known: Bools, settings: Settings, shear: Array, load: Array
) -> tuple[Array, Array]:
    """Least and largest pull (m,) [N] of stresses that turn the wheel with this torque; shear:
    T/r (m,) [N]; load (m,) [N].

    All stress at one angle θ gives DP = T/(r cos θ) − W tan θ, and the contact lies between 0
    and θ₁. Eqs. (8)-(10) are sums of such. A motor's torque holds what the drive
    loses, so nothing is the least.
    """
    if settings.drive.torque_source != "wrench":
        return np.full(shear.size, -np.inf), shear
    sinkage = course.sinkage[known] + 0.5 * datum(settings)
    angle = entry_angle(settings.wheel, np.nan_to_num(sinkage, nan=settings.wheel.radius))
    deepest = shear / np.cos(angle) - load * np.tan(angle)
    return np.minimum(deepest, shear), np.maximum(deepest, shear)


def _outside(pull: Array, least: Array, most: Array, load: Array) -> float:
    """How far most of the pulls (n,) lie outside their bounds, over the load (n,); 0 within a
    tolerance.
    """
    off = np.maximum(least - pull, pull - most) / load
    worst = float(np.percentile(off, 100.0 * MOST))
    return worst if worst > 0.5 * TOLERANCE else 0.0
