"""Many trials, resumable, with progress."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.cli.command import USAGE, CommandError
from gritd.tools.proof.blind import seal, strata, trial
from gritd.tools.proof.blind.plant.worlds import WORLDS
from gritd.tools.proof.blind.trial import WorkerSpec

BATCH, SECRET = "batch.json", "answers/batch.json"
AHEAD = 2  # cases in hand for every worker


@dataclass(frozen=True)
class Batch:
    """What a batch is; `sealed` is public before any diagnosis, `secret` is what every case is
    drawn from.
    """

    output: Path
    cases: int
    strata: tuple[str, ...]
    worlds: tuple[str, ...]
    secret: str
    sealed: str

    def specs(
        self, keep: bool = False, diagnose: tuple[str, ...] = trial.DIAGNOSE
    ) -> list[WorkerSpec]:
        rng = np.random.default_rng(_number(self.secret, "assignments"))
        drawn = strata.assignments(self.cases, rng, self.strata, self.worlds)

        return [
            WorkerSpec(
                number,
                _number(self.secret, f"case {number}"),
                assignment,
                str(self.output),
                keep,
                diagnose,
            )
            for number, assignment in enumerate(drawn, start=1)
        ]


def _number(secret: str, purpose: str) -> int:
    """63 bits that only the secret foretells."""
    return int.from_bytes(hashlib.sha256(f"{secret}/{purpose}".encode()).digest()[:8], "big") >> 1


def started(
    output: Path,
    cases: int,
    chosen: tuple[str, ...],
    seed: int | None,
    worlds: tuple[str, ...] = WORLDS,
) -> Batch:
    """A new batch, from the operating system's randomness or from a seed. Raises CommandError where
    one is there.
    """
    if (output / BATCH).exists():
        raise CommandError(f"{output}: found a batch; expected a new folder, or --resume", USAGE)

    secret = secrets.token_hex(32) if seed is None else f"seed {seed}"
    public_part = {"cases": cases, "strata": list(chosen), "worlds": list(worlds)}
    sealed = seal.close(output / SECRET, {"secret": secret, **public_part})
    (output / "answers").chmod(0o700)

    public = {**public_part, "seal": sealed}
    (output / BATCH).write_text(json.dumps(public, indent=1), encoding="utf-8")
    return Batch(output, cases, chosen, worlds, secret, sealed)


def resumed(output: Path) -> Batch:
    """A batch that was begun before. Raises CommandError where there is none."""
    try:
        public = json.loads((output / BATCH).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise CommandError(
            f"{output}: found no batch; expected one that was begun without --resume", USAGE
        ) from None

    if "worlds" not in public:
        reason = "found a batch of an earlier version, whose cases this one cannot draw"
        raise CommandError(f"{output}: {reason}; expected one of this version", USAGE)

    answers = seal.opened(output / SECRET, public["seal"])
    return Batch(
        output,
        answers["cases"],
        tuple(answers["strata"]),
        tuple(answers["worlds"]),
        answers["secret"],
        public["seal"],
    )


def run(
    specs: Sequence[WorkerSpec],
    executor: Executor,
    width: int,
    sealed: Callable[[WorkerSpec, str], None],
    finished: Callable[[WorkerSpec], None],
    diagnosed: bool = True,
) -> None:
    """Every case that is not done: prepared, its seal published, then diagnosed if wanted. An error
    ends the batch.
    """
    waiting = [spec for spec in specs if not spec.done]
    waiting.reverse()
    active: dict[Future[Any], tuple[WorkerSpec, bool]] = {}

    while waiting or active:
        while waiting and len(active) < AHEAD * width:
            spec = waiting.pop()
            active[executor.submit(trial.prepare, spec)] = (spec, False)

        done, _ = wait(active, return_when=FIRST_COMPLETED)
        for future in done:
            spec, last = active.pop(future)
            value = future.result()

            if last:
                finished(spec)
                continue

            sealed(spec, value)
            if not diagnosed:
                finished(spec)
                continue
            active[executor.submit(trial.diagnose, spec)] = (spec, True)
