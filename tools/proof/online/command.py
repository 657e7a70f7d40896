"""`gritd prove --online`: whether the filter is right and honest on benches nobody has seen."""

from __future__ import annotations

import json
from argparse import Namespace

from gritd.tools.cli.command import DONE, USAGE, CommandError
from gritd.tools.cli.progress import Progress
from gritd.tools.proof.blind import seal
from gritd.tools.proof.online import batch
from gritd.tools.proof.online.draw import STRATA

TABLE, SCORES = "online.md", "scores.json"


def prove(arguments: Namespace) -> int:
    """Draw, seal, estimate, open, print. Raises CommandError."""
    strata = tuple(arguments.strata.split(",")) if arguments.strata else STRATA
    if unknown := [name for name in strata if name not in STRATA]:
        known = ",".join(STRATA)
        reason = f"found '{unknown[0]}'; expected some of {known}"
        raise CommandError(f"--strata {arguments.strata}: {reason}", USAGE)

    arguments.output.mkdir(parents=True, exist_ok=True)
    specs = batch.specs(arguments.cases, strata, arguments.seed)
    digest = batch.sealed(specs, arguments.output)
    print(f"{len(specs)} benches; sealed before any estimate, SHA-256 {digest}", flush=True)

    with Progress("benches", len(specs)) as progress:
        scores = batch.run(specs, arguments.jobs, progress.advance)
    seal.opened(arguments.output / batch.ANSWERS, digest)

    lines = list(batch.table(scores))
    (arguments.output / TABLE).write_text("\n".join(lines) + "\n", encoding="utf-8")
    each = [
        {**spec._asdict(), **score._asdict()} for spec, score in zip(specs, scores, strict=True)
    ]
    (arguments.output / SCORES).write_text(json.dumps(each, indent=1) + "\n", encoding="utf-8")
    print("\n".join(lines))
    return DONE
