"""Tables of many cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.estimate import KPA
from gritd.tools.dev.soil_changes.cases import KINDS, UNCHANGED, SoilChangeCase, case
from gritd.tools.dev.soil_changes.followed import BACK, FollowedCase, Track, begun, followed, judged
from gritd.tools.testbed import plant


def verdicts(
    settings: Settings, seeds: Sequence[int], of: plant.PlantKind, rate: float
) -> Iterator[tuple[SoilChangeCase, FollowedCase]]:
    """Every seed as one of the kinds in turn."""
    for seed in seeds:
        each = case(settings, KINDS[(seed // 4) % len(KINDS)], seed, of, rate)
        yield each, judged(each, followed(each))


def table(judgements: Sequence[tuple[SoilChangeCase, FollowedCase]]) -> str:
    """One line a kind, and one for all."""
    head = (
        f"{'change':18}{'cases':>6}{'beyond 3σ':>11}{'beyond 5σ':>11}{'flagged':>9}"
        f"{'2σ in 15 s':>12}{'median':>9}{'90 %':>8}{'NEES':>7}"
    )

    groups: list[tuple[str, list[FollowedCase]]] = [
        (f"{kind}, {'loads vary' if varied else 'one load'}", kept)
        for kind in KINDS
        for varied in (True, False)
        if (kept := [v for c, v in judgements if (c.kind, c.varied) == (kind, varied)])
    ]

    groups.append(("all", [verdict for _, verdict in judgements]))
    return "\n".join([head, *(_line(name, group) for name, group in groups)])


def _line(name: str, group: Sequence[FollowedCase]) -> str:
    total = sum(v.driven for v in group)
    back = np.array([v.back for v in group])
    return (
        f"{name:18}{len(group):6}{sum(v.beyond for v in group) / total:11.2%}"
        f"{sum(v.far for v in group) / total:11.2%}{sum(v.warned for v in group) / total:9.1%}"
        f"{np.mean(back <= BACK):12.0%}{np.median(back):7.1f} s"
        f"{np.quantile(back, 0.9, method='nearest'):6.1f} s{np.mean([v.nees for v in group]):7.2f}"
    )


def unchanged(
    settings: Settings, seeds: Sequence[int], of: plant.PlantKind, rate: float
) -> Iterator[tuple[SoilChangeCase, Track]]:
    for seed in seeds:
        each = case(settings, "none", seed, of, rate)
        yield each, followed(each)


def quiet(tracks: Sequence[Track]) -> str:
    """False flags and honesty of runs without a change."""
    hours = len(tracks) * UNCHANGED / 3600.0
    flags = [begun(track) for track in tracks]
    beyond = np.concatenate([(track.away > 3.0) & ~track.warned for track in tracks])
    within = np.concatenate([track.away <= 2.0 for track in tracks])
    nees = [track.nees[-1] for track in tracks]
    sigma_c, sigma_t = np.median([track.sigma[-1] for track in tracks], axis=0)

    return (
        f"unchanged, {hours:.1f} h: {sum(flags)} flags in {sum(f > 0 for f in flags)} of"
        f" {len(tracks)} runs, {sum(flags) / hours:.2f} an hour; beyond 3σ without a flag"
        f" {beyond.mean():.2%} of the time, within 2σ {within.mean():.1%};"
        f" NEES {np.mean(nees):.2f} of 2; median σ at the end {sigma_c * KPA:.0f} Pa,"
        f" {sigma_t:.4f}"
    )
