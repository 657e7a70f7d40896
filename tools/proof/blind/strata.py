"""Which kinds of case a batch holds, and how many of each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import TypeVar

import numpy as np

from gritd.tools.proof.blind.groups import CONFOUNDED, alike
from gritd.tools.proof.blind.plant.concealed import ABSORBED, LISTED, UNLISTED
from gritd.tools.proof.blind.plant.worlds import PAPER, WORLDS, concealable

Item = TypeVar("Item")

SHARES = {
    "none": 0.15,
    "awkward": 0.10,
    "single": 0.14,
    "usual": 0.13,
    "absorbed": 0.03,
    "confounded": 0.03,
    "two": 0.05,
    "unlisted": 0.08,
    "foreign": 0.10,
    "pair": 0.13,
    "table": 0.06,
}
STRATA = tuple(SHARES)
# times the detection limit; the strongest is what bends the form of the model most
LEVELS = {"weak": 1.5, "medium": 4.0, "strong": 12.0, "very strong": 40.0}
USUAL = "usual"  # a level: as strong as such an effect is on a testbed, however well it shows
PLAIN = ("medium", "strong")  # levels in foreign worlds and of what is new
# What one case in so many conceals, in foreign worlds and as what is new: one of the list,
# nothing, or physics outside the list.
FOREIGN_KINDS = ("nothing", "listed", "listed")
PAIR_KINDS = ("nothing", "nothing", "listed", "listed", "listed", "unlisted")
TABLE_KINDS = ("nothing", "nothing", "lugs", "lugs", "listed", "listed", "unlisted")
LUGS = ("grousers",)  # what laboratories print beside a smooth wheel
STEADY = (  # what a steady state shows
    "bulldozing", "sidewall_friction", "shear_peak", "rear_contact", "stress_peak_shift",
    "slip_sinkage", "rim_friction", "wheel_radius_error", "bed_slope", "frame_compliance",
    "side_wall_rubbing", "coulomb_friction", "load_dependent_friction", "torque_constant_error",
    "force_crosstalk", "sinkage_datum", "sinkage_gain",
)  # fmt: skip
# a table tells nothing of the course: every stretch is one row
COURSE = (
    ("standstill", False), ("reversal", False), ("lifted", False), ("second_pass", False),
    ("staircase", False), ("speeds", False), ("wrench", True),
)  # fmt: skip
BEDS = ("same", "prepared")
PAIR_RUNS = (2, 3, 4)  # of each campaign of a pair


@dataclass(frozen=True)
class Assignment:
    """What one case conceals: nothing, or effects at a level; where, and how it is recorded."""

    stratum: str
    effects: tuple[str, ...] = ()
    level: str = ""  # of an awkward campaign: what is awkward
    without: tuple[tuple[str, bool | int], ...] = ()  # of the design, what is fixed
    world: str = PAPER
    bed: str = ""  # of BEDS where a reference campaign comes first; else there is none
    noise: str = ""  # "tall": 2.5 times what is stated; "slow": correlated 0.95 from 0.1 s to 0.1 s

    @property
    def pair(self) -> bool:
        return bool(self.bed)

    @property
    def printed(self) -> bool:
        """Whether it is handed over as tables of steady states."""
        return self.stratum == "table"


AWKWARD = (
    Assignment("awkward", level="load measured", without=(("wrench", True), ("weighed", True))),
    Assignment("awkward", level="noise x 2.5", noise="tall"),
    Assignment("awkward", level="correlated 0.95", noise="slow"),
    Assignment("awkward", level="no wrench", without=(("wrench", False),)),
    Assignment("awkward", level="one run", without=(("runs", 1),)),
    Assignment(
        "awkward",
        level="many runs",
        without=(("runs", 40), ("loads", 4), ("staircase", True), ("wrench", True)),
    ),
    Assignment(
        "awkward",
        level="loads in a run",
        without=(("loads", 4), ("staircase", True), ("wrench", True)),
    ),
)


def assignments(
    cases: int,
    rng: np.random.Generator,
    strata: tuple[str, ...] = STRATA,
    worlds: tuple[str, ...] = WORLDS,
) -> list[Assignment]:
    """As many as cases, strata by their shares, effects and levels in turn, the order of chance.

    `worlds`: those of foreign campaigns, pairs and tables; the others are at home in the paper's.
    """
    counts = _counts(cases, strata)
    drawn = [item for stratum, count in counts.items() for item in _of(stratum, count, worlds, rng)]

    return [drawn[place] for place in rng.permutation(len(drawn))]


def _counts(cases: int, strata: tuple[str, ...]) -> dict[str, int]:
    """Largest remainders."""
    total = sum(SHARES[name] for name in strata)
    exact = {name: cases * SHARES[name] / total for name in strata}
    counts = {name: int(value) for name, value in exact.items()}
    by_remainder = sorted(strata, key=lambda name: counts[name] - exact[name])
    for name in by_remainder[: cases - sum(counts.values())]:
        counts[name] += 1
    return counts


def _of(
    stratum: str, count: int, worlds: tuple[str, ...], rng: np.random.Generator
) -> list[Assignment]:
    if stratum == "none":
        return [Assignment("none")] * count
    if stratum == "awkward":
        return _shuffled(AWKWARD, count, rng)
    if stratum == "two":
        return [_two(rng) for _ in range(count)]
    if stratum == "confounded":
        numbers = _shuffled(range(len(CONFOUNDED)), count, rng)
        return [_confounded(number, rng) for number in numbers]
    if stratum == "foreign":
        foreign = tuple(world for world in worlds if world != PAPER)
        return _in_worlds("foreign", count, foreign, FOREIGN_KINDS, rng)
    if stratum == "pair":
        return [_paired(one, rng) for one in _in_worlds("pair", count, worlds, PAIR_KINDS, rng)]
    if stratum == "table":
        drawn = _in_worlds("table", count, worlds, TABLE_KINDS, rng, STEADY)
        return [_paired(replace(one, without=COURSE), rng) for one in drawn]

    if stratum == "usual":
        return [Assignment("usual", (name,), USUAL) for name in _shuffled(LISTED, count, rng)]

    names = {"single": tuple(LISTED), "absorbed": ABSORBED, "unlisted": tuple(UNLISTED)}[stratum]
    leveled = _at_levels(names, count, tuple(LEVELS), rng)
    return [Assignment(stratum, (name,), level) for name, level in leveled]


def _at_levels(
    names: Iterable[str], count: int, levels: tuple[str, ...], rng: np.random.Generator
) -> list[tuple[str, str]]:
    """Names in turn, each at its levels in turn, where it begins by chance."""
    begun = {name: int(rng.integers(len(levels))) for name in names}
    assigned = []
    for name in _shuffled(begun, count, rng):
        assigned.append((name, levels[begun[name] % len(levels)]))
        begun[name] += 1
    return assigned


def _shuffled(given: Iterable[Item], count: int, rng: np.random.Generator) -> list[Item]:
    """`count` items, each as often as the others but for chance in the last round."""
    items = list(given)
    chosen: list[Item] = []
    while len(chosen) < count:
        chosen += [items[place] for place in rng.permutation(len(items))]
    return chosen[:count]


def _two(rng: np.random.Generator) -> Assignment:
    names = list(LISTED)
    while True:
        first, second = (names[place] for place in rng.choice(len(names), 2, replace=False))
        if second not in alike(first):
            return Assignment("two", (first, second), "strong")


def _confounded(number: int, rng: np.random.Generator) -> Assignment:
    first, second, without = CONFOUNDED[number]
    chosen = first if rng.random() < 0.5 else second
    return Assignment("confounded", (chosen,), "strong", tuple(without.items()))


def _in_worlds(
    stratum: str,
    count: int,
    worlds: tuple[str, ...],
    kinds: tuple[str, ...],
    rng: np.random.Generator,
    listed: tuple[str, ...] = tuple(LISTED),
) -> list[Assignment]:
    """Worlds and kinds in turn; names in turn, those left out that a world has of its own."""
    kinds_of = {"listed": listed, "unlisted": tuple(UNLISTED), "lugs": LUGS}
    waiting = {kind: _at_levels(of, 2 * count, PLAIN, rng) for kind, of in kinds_of.items()}

    assigned = []
    for world, kind in _shuffled(product(worlds, kinds), count, rng):
        fixed = (("second_pass", False),) if world == "strips" else ()
        one = Assignment(stratum, without=fixed, world=world)
        if kind != "nothing":
            name, level = _next(waiting[kind], world)
            one = replace(one, effects=(name,), level=level)
        assigned.append(one)

    return assigned


def _next(waiting: list[tuple[str, str]], world: str) -> tuple[str, str]:
    """The first that can be new in a world, taken from those that wait."""
    allowed = concealable(world, tuple(name for name, _ in waiting))
    place = next(place for place, (name, _) in enumerate(waiting) if name in allowed)
    return waiting.pop(place)


def _paired(one: Assignment, rng: np.random.Generator) -> Assignment:
    runs = int(rng.choice(PAIR_RUNS))
    return replace(one, without=(*one.without, ("runs", runs)), bed=str(rng.choice(BEDS)))
