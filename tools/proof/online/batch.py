"""`gritd prove --online`: benches drawn, sealed, estimated, opened and scored."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from gritd.tools.proof.blind import seal
from gritd.tools.proof.online.draw import CHANGES, LEFT_OUT, STRATA, drawn
from gritd.tools.proof.online.judge import Score, handed_over, scored

ANSWERS = "answers.json"


class BatchSpec(NamedTuple):
    stratum: str
    seed: int


def specs(count: int, strata: Sequence[str], seed: int | None) -> list[BatchSpec]:
    """Benches in turn over the strata; without a seed nobody can foretell them."""
    first = secrets.randbits(40) if seed is None else seed
    return [BatchSpec(strata[n % len(strata)], first + n) for n in range(count)]


def sealed(chosen: Sequence[BatchSpec], folder: Path) -> str:
    """Write the answers; their hash."""
    answers: dict[str, Any] = {
        f"{spec.stratum}-{spec.seed}": _plain(asdict(drawn(*spec))) for spec in chosen
    }
    return seal.close(folder / ANSWERS, answers)


def _plain(value: Any) -> Any:
    """JSON's types."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return float(value) if isinstance(value, np.floating) else value


def run(chosen: Sequence[BatchSpec], jobs: int, advance: Callable[[], None]) -> list[Score]:
    """All scores, in the order of the specs."""
    with ProcessPoolExecutor(jobs) as executor:
        found = []
        for score in executor.map(one, chosen):
            found.append(score)
            advance()
    return found


def one(spec: BatchSpec) -> Score:
    bench = drawn(*spec)
    with TemporaryDirectory() as place:
        folder = Path(place) / "bench"
        exact = handed_over(bench, folder)
        return scored(bench, folder, exact)


# --- the table ---


def table(scores: Sequence[Score]) -> Iterator[str]:
    """A row a stratum, as markdown."""
    yield (
        "| stratum | benches | believed | within 2σ, 3σ | NEES of 2 | "
        "σ of c over the exact fit's | first belief | beyond 3σ without a flag |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for stratum in STRATA:
        group = [score for score in scores if score.stratum == stratum]
        if group:
            yield _row(stratum, group)

    unchanged = [s for s in scores if s.stratum not in (*LEFT_OUT, *CHANGES)]
    hours = sum([score.hours for score in unchanged])
    changes = sum([score.changes for score in unchanged])
    yield ""
    yield f"Changes said in {hours:.1f} h of unchanged soil, nothing left out: {changes}."
    yield from _summary(scores)


def _row(stratum: str, group: Sequence[Score]) -> str:
    believed = [score for score in group if score.believed]
    within = [_within(believed, sigma) for sigma in (2.0, 3.0)]
    nees = f"{np.mean([s.nees for s in believed]):.2f}" if believed else ""
    ratios = [s.sigma_c / s.exact_sigma_c for s in believed if isfinite(s.exact_sigma_c)]
    first = [s.first for s in group if isfinite(s.first)]
    silent = [s.silent for s in group if isfinite(s.silent)]
    if stratum in CHANGES:
        return (
            f"| `{stratum}` | {len(group)} | | | | | {_median(first, ' s')} | "
            f"{np.mean(silent):.1%} |"
        )
    return (
        f"| `{stratum}` | {len(group)} | {len(believed)} | {within[0]}, {within[1]} of "
        f"{len(believed)} | {nees} | {_median(ratios, '')} | {_median(first, ' s')} | |"
    )


def _median(values: Sequence[float], unit: str) -> str:
    return f"{np.median(values):.1f}{unit}" if values else ""


def _within(scores: Sequence[Score], sigma: float) -> int:
    return sum([abs(score.c) <= sigma and abs(score.tan_phi) <= sigma for score in scores])


def _summary(scores: Sequence[Score]) -> Iterator[str]:
    whole = [s for s in scores if s.stratum not in (*LEFT_OUT, *CHANGES)]
    believed = [s for s in whole if s.believed]
    yield (
        f"Nothing left out: believed {len(believed)} of {len(whole)}; within 2σ "
        f"{_within(believed, 2.0)}, within 3σ {_within(believed, 3.0)} of {len(believed)}."
    )
    out = [s for s in scores if s.stratum in LEFT_OUT]
    right = [s for s in out if not s.believed or _within([s], 3.0)]
    yield f"Something left out: not believed, or within 3σ, {len(right)} of {len(out)}."


__all__ = ["BatchSpec", "one", "run", "sealed", "specs", "table"]
