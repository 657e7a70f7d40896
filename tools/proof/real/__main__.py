"""`python -m gritd.tools.proof.real`: the proofs on recordings of others, and what
docs/real-recordings.md says of them.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

from gritd.tools.cli.command import DONE, FAILED, USAGE, CommandError, Parser
from gritd.tools.cli.guard import guarded
from gritd.tools.cli.progress import Progress
from gritd.tools.proof.real import chrono, cmu, ding, emps, figure, mgst, steered
from gritd.tools.proof.real.bench import ROOT, CommandBench
from gritd.tools.proof.real.page import page, section
from gritd.tools.proof.real.proof import Finding, Proof

PROOFS: tuple[Proof, ...] = (
    mgst.DRIVETRAIN,
    mgst.SIDE_WALL,
    cmu.GROUSERS,
    steered.STEERED,
    emps.FRICTION,
    ding.STRENGTH,
    chrono.TERRAIN,
)
DATA = ROOT.parent / "shared" / "real"
DOCS, PAGE = ROOT / "docs", "real-recordings.md"


def main(argv: Sequence[str] | None = None) -> int:
    """Redo the proofs and write their sections and figures. Exit 0; 1 if a command failed, the
    others are made.

    A question that is missed is no failure of the command: it stands in the page.
    """
    arguments = _parser().parse_args(argv)
    chosen = [p for p in PROOFS if not arguments.only or p.name in arguments.only]
    failed = False

    for number, proof in enumerate(chosen, start=1):
        missing = arguments.data / proof.rig
        if not missing.is_dir():
            print(
                f"{proof.title}: skipped, found no {missing}; "
                "docs/importing.md says where the data are"
            )
            continue

        try:
            _prove(proof, arguments.data, arguments.output, f"{number} of {len(chosen)}")
        except CommandError as error:
            print(f"gritd: {proof.name}: {error}", file=sys.stderr)
            failed = True

    return FAILED if failed else DONE


def _prove(proof: Proof, data: Path, folder: Path, place: str) -> None:
    """One proof; its section of the page and its figure are written."""
    began = time.monotonic()

    with tempfile.TemporaryDirectory(prefix="gritd-proof-") as work, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        with Progress(f"{place}, {proof.name}") as progress:
            finding = proof.run(bench := CommandBench(data.resolve(), Path(work), progress.at))

    seconds = time.monotonic() - began
    _print(proof, finding, seconds)
    figure.draw(folder / f"proof-{proof.name}.png", finding.panels)

    target = folder / PAGE
    old = target.read_text(encoding="utf-8") if target.exists() else "# Proofs on real recordings\n"
    target.write_text(
        page(old, proof.name, section(proof, finding, bench.commands, seconds)), encoding="utf-8"
    )


def _print(proof: Proof, finding: Finding, seconds: float) -> None:
    print(
        f"{proof.title}: {sum(a.met for a in finding.checks)} of {len(finding.checks)} as wanted, "
        f"{seconds:.0f} s"
    )
    for check in finding.checks:
        print(
            f"  {'yes' if check.met else 'NO '} {check.question} wanted {check.wanted}; "
            f"found {check.answer}"
        )


def _parser() -> Parser:
    parser = Parser(
        prog="python -m gritd.tools.proof.real",
        description="Proofs of diagnose on other laboratories' recordings.",
    )

    parser.add_argument(
        "--data", type=_folder, default=DATA, metavar="DIR", help="the public files, a folder a rig"
    )
    names = [p.name for p in PROOFS]
    parser.add_argument(
        "--only", action="append", choices=names, metavar="NAME", help=f"of {', '.join(names)}"
    )
    parser.add_argument(
        "--output",
        type=_folder,
        default=DOCS,
        metavar="DIR",
        help="where the page and its figures go",
    )

    return parser


def _folder(text: str) -> Path:
    path = Path(text)
    if not path.is_dir():
        raise CommandError(f"{path}: found no folder; expected one", USAGE)
    return path


if __name__ == "__main__":
    sys.exit(guarded(main))
