"""`gritd prove`: blind trials of the diagnosis, sealed, scored, resumable, on this computer or on a
cluster; and with --online of the filter.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path

from gritd.tools.cli.command import DONE, FAILED, USAGE, CommandError, Parser
from gritd.tools.cli.progress import Progress
from gritd.tools.cli.workers import add_cluster, cluster_of, workers
from gritd.tools.proof.blind import batch, page, score, tables, trial
from gritd.tools.proof.blind.plant.worlds import FOREIGN, PAPER, WORLDS
from gritd.tools.proof.blind.strata import STRATA
from gritd.tools.proof.blind.verdicts import CaseRow, row
from gritd.tools.proof.online.draw import STRATA as ONLINE

SCORE, PAGE, SEALS = "score.json", "score.html", "seals.txt"
OUTPUT = Path("proof")


def main(argv: Sequence[str], diagnose: tuple[str, ...] = trial.DIAGNOSE) -> int:
    """Run the trials, open the answers, print the score; 1 where a diagnosis failed. Raises
    CommandError.
    """
    arguments = build_parser().parse_args(argv)
    if arguments.online:
        # it loads what is judged, which the trials of the diagnosis must not
        from gritd.tools.proof.online import command

        return command.prove(arguments)
    cluster_of(arguments)
    output: Path = arguments.output
    begun = batch.resumed(output) if arguments.resume else _started(arguments)
    print(
        f"{begun.cases} cases in {output}; sealed before any diagnosis, SHA-256 {begun.sealed}",
        flush=True,
    )

    specs = begun.specs(arguments.keep, diagnose)
    _run(specs, arguments, output / SEALS)

    if arguments.seal_only:
        print(f"all sealed, {output / SEALS}; go on with: gritd prove --resume --output {output}")
        return DONE

    rows = [row(spec) for spec in specs]
    _print(rows, begun, output)
    return FAILED if any(each.verdict == "failed" for each in rows) else DONE


def _started(arguments: argparse.Namespace) -> batch.Batch:
    chosen = _some_of("--strata", arguments.strata, STRATA)
    worlds = _some_of("--worlds", arguments.worlds, WORLDS)
    if "foreign" in chosen and worlds == (PAPER,):
        reason = f"--worlds {PAPER}: found no foreign world for the stratum foreign; expected"
        raise CommandError(f"{reason} one of {','.join(FOREIGN)}", USAGE)
    arguments.output.mkdir(parents=True, exist_ok=True)
    return batch.started(arguments.output, arguments.cases, chosen, arguments.seed, worlds)


def _some_of(option: str, text: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """Names of a list, all of them where nothing is said. Raises CommandError."""
    chosen = tuple(text.split(",")) if text else known
    unknown = [name for name in chosen if name not in known]
    if unknown:
        reason = f"found '{unknown[0]}'; expected some of {','.join(known)}"
        raise CommandError(f"{option} {text}: {reason}", USAGE)
    return chosen


def _run(specs: Sequence[trial.WorkerSpec], arguments: argparse.Namespace, seals: Path) -> None:
    left = sum(not spec.done for spec in specs)
    known = set(seals.read_text(encoding="utf-8").split()) if seals.exists() else set()
    with (
        seals.open("a", encoding="utf-8") as published,
        workers(arguments.jobs, cluster_of(arguments)) as (executor, width),
        Progress("cases", left) as progress,
    ):

        def sealed(spec: trial.WorkerSpec, digest: str) -> None:
            if digest not in known:
                published.write(f"{spec.name} {digest}\n")
                published.flush()

        batch.run(
            specs,
            executor,
            width,
            sealed,
            lambda _: progress.advance(),
            diagnosed=not arguments.seal_only,
        )


def _print(rows: Sequence[CaseRow], begun: batch.Batch, output: Path) -> None:
    counted = score.score(rows)
    (output / SCORE).write_text(
        json.dumps(counted, indent=1, ensure_ascii=False, allow_nan=False), encoding="utf-8"
    )
    (output / PAGE).write_text(page.page(counted, rows, begun.sealed), encoding="utf-8")
    print(f"answers opened: all {len(rows)} are as sealed; they were drawn from {begun.secret}\n")
    print(tables.text(counted, rows))
    print(f"\n{output / SCORE}, {output / PAGE}")


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="gritd prove",
        description="Blind trials: an independent plant conceals, `gritd diagnose` names.",
    )
    parser.add_argument(
        "--online",
        action="store_true",
        help="the filter instead: benches of strangers as tables, `gritd estimate` finds the soil; "
        f"--strata: some of {','.join(ONLINE)}",
    )
    parser.add_argument("--cases", type=_positive, default=60, metavar="N", help="default 60")
    parser.add_argument(
        "--seed", type=int, help="for a batch that can be repeated; default: nobody can foretell it"
    )
    parser.add_argument(
        "--jobs", type=_positive, default=os.cpu_count() or 1, metavar="J", help="cases at a time"
    )
    parser.add_argument(
        "--strata", default="", metavar="A,B", help=f"some of {','.join(STRATA)}; default: all"
    )
    parser.add_argument(
        "--worlds",
        default="",
        metavar="A,B",
        help=f"of the strata foreign, pair and table, some of {','.join(WORLDS)}; default: all",
    )
    parser.add_argument(
        "--output", type=Path, default=OUTPUT, metavar="DIR", help=f"default {OUTPUT}"
    )
    parser.add_argument("--resume", action="store_true", help="go on with the batch in DIR")
    parser.add_argument(
        "--seal-only",
        action="store_true",
        help="draw and seal all cases; diagnose them later with --resume",
    )
    parser.add_argument("--keep", action="store_true", help="keep the recordings, about 1 MB a run")
    add_cluster(parser)

    return parser


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"found {text}; expected a whole number, 1 or more")
    return int(text)
