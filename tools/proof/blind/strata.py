"""Which kinds of case a batch holds, and how many of each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from gritd.tools.proof.blind.groups import CONFOUNDED, alike
from gritd.tools.proof.blind.plant.concealed import ABSORBED, LISTED, UNLISTED

Item = TypeVar("Item")

STRATA = ("none", "single", "absorbed", "confounded", "two", "unlisted")
SHARES = {
    "none": 0.32,
    "single": 0.32,
    "absorbed": 0.09,
    "confounded": 0.06,
    "two": 0.08,
    "unlisted": 0.13,
}
LEVELS = {"weak": 1.5, "medium": 4.0, "strong": 12.0}  # times the detection limit


@dataclass(frozen=True)
class Assignment:
    """What one case conceals: nothing, or effects at a level."""

    stratum: str
    effects: tuple[str, ...] = ()
    level: str = ""
    without: tuple[tuple[str, bool | int], ...] = ()  # habits that are fixed


def assignments(
    cases: int, rng: np.random.Generator, strata: tuple[str, ...] = STRATA
) -> list[Assignment]:
    """As many as cases, strata by their shares, effects and levels in turn, the order of chance."""
    counts = _counts(cases, strata)
    drawn = [item for stratum, count in counts.items() for item in _of(stratum, count, rng)]
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


def _of(stratum: str, count: int, rng: np.random.Generator) -> list[Assignment]:
    if stratum == "none":
        return [Assignment("none")] * count
    if stratum == "two":
        return [_two(rng) for _ in range(count)]
    if stratum == "confounded":
        return [
            _confounded(number, rng) for number in _shuffled(range(len(CONFOUNDED)), count, rng)
        ]
    names = {"single": tuple(LISTED), "absorbed": ABSORBED, "unlisted": tuple(UNLISTED)}[stratum]
    return [Assignment(stratum, (name,), level) for name, level in _at_levels(names, count, rng)]


def _at_levels(names: Iterable[str], count: int, rng: np.random.Generator) -> list[tuple[str, str]]:
    """Names in turn, each at its levels in turn, where it begins by chance."""
    begun = {name: int(rng.integers(len(LEVELS))) for name in names}
    found = []
    for name in _shuffled(begun, count, rng):
        found.append((name, list(LEVELS)[begun[name] % len(LEVELS)]))
        begun[name] += 1
    return found


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
