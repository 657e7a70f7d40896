"""The attacks of the list of faults on a gritd from outside: its devices, sockets, files and
signals. `python -m gritd.tools.dev.attack [--python PYTHON] [--rows 62-84] [--quick]`.

The attacks are the scenarios of `tests/scenarios`. By default they go at the gritd of this
repository. With --python they go at the one that is installed beside another interpreter, which
needs what `pip install 'gritd[test]'` installs. What comes out is a table with counts; `--figures`
keeps what was measured, and docs/reliability.md is made from it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from gritd.tools.cli.command import DONE, FAILED, Parser, whole
from gritd.tools.dev.faults import FAULTS, Fault

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = Path("tests", "scenarios")
FIGURES = "GRITD_FIGURES"  # as in tests/scenarios/conftest.py
DEVELOPMENT = "gritd.tools.dev"  # is not installed

Figure = dict[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """Exit 1 if an attack succeeds: a scenario fails, or a figure is above its limit."""
    arguments = _parser().parse_args(argv)
    chosen = [fault for fault in FAULTS if _is_in(fault, arguments.rows)]

    with tempfile.TemporaryDirectory() as folder:
        figures = Path(arguments.figures or Path(folder, "figures.jsonl")).absolute()
        python, place = sys.executable, ROOT
        if arguments.python:
            python, place = arguments.python, _copied(Path(folder))
        modules = modules_of(place, chosen, installed=bool(arguments.python))
        code = run(figures, modules, python, place, arguments.quick, arguments.jobs)
        measured = read(figures) if figures.exists() else []

    print("\n".join(_table(chosen, measured)))
    names = {fault.name for fault in chosen}
    beaten = any(above(figure) for figure in measured if figure["row"] in names)
    return FAILED if code or beaten else DONE


def _parser() -> Parser:
    parser = Parser(prog="python -m gritd.tools.dev.attack", description="Attack a gritd.")
    parser.add_argument(
        "--python", metavar="PYTHON", help="of the environment in which gritd is installed"
    )
    parser.add_argument(
        "--rows", type=_rows, metavar="A-B", help="of the list of faults; default: all"
    )
    parser.add_argument("--quick", action="store_true", help="without the long ones")
    parser.add_argument(
        "--jobs", type=whole(1, 64), default=1, metavar="J", help="scenarios side by side"
    )
    parser.add_argument("--figures", metavar="FILE", help="keep what is measured")
    return parser


def _rows(text: str) -> range:
    """An argparse type: a row or some, `62` or `62-84`."""
    if not (found := re.fullmatch(r"(\d{1,3})(?:-(\d{1,3}))?", text)):
        raise argparse.ArgumentTypeError(f"found {text[:40]!r}; expected rows such as 62-84")
    return range(int(found[1]), int(found[2] or found[1]) + 1)


def _is_in(fault: Fault, rows: range | None) -> bool:
    return rows is None or any(row in rows for row in fault.rows)


def _copied(folder: Path) -> Path:
    """The tests without the program: what they import is what is installed."""
    shutil.copytree(ROOT / "tests", folder / "tests", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def modules_of(place: Path, faults: Sequence[Fault], installed: bool = False) -> list[Path]:
    """The scenarios that name one of the faults; of an installed gritd those that need nothing
    else of this repository.
    """
    found = []
    for path in sorted((place / SCENARIOS).glob("test_*.py")):
        text = path.read_text(encoding="utf-8")
        if installed and DEVELOPMENT in text:
            print(f"{path.name}: needs this repository, left out", file=sys.stderr)
        elif any(fault.name in text for fault in faults):
            found.append(path)
    return found


def run(
    figures: Path, modules: Sequence[Path], python: str, place: Path, quick: bool, jobs: int
) -> int:
    """pytest's exit code; what the scenarios measure goes into a file."""
    chosen = "not slow" if quick else "slow or not slow"
    side_by_side = ["-n", str(jobs), "--dist", "worksteal"] if jobs > 1 else []
    command = [python, "-m", "pytest", "--quiet", "-rs", "-m", chosen, *side_by_side]
    environment = {**os.environ, FIGURES: str(figures)}
    return subprocess.run(
        [*command, *map(str, modules)], env=environment, cwd=place, check=False
    ).returncode


def read(path: Path) -> list[Figure]:
    """What scenarios measured."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def above(figure: Figure) -> bool:
    """Whether a figure is above its limit."""
    return figure["limit"] is not None and bool(figure["value"] > figure["limit"])


def _table(faults: Sequence[Fault], figures: Sequence[Figure]) -> Iterator[str]:
    """A line for each fault: how many scenarios, what they measured, what was above its limit."""
    yield f"{'rows':>7}  {'runs':>4} {'figures':>7} {'above':>5}  fault"
    for fault in faults:
        own = [figure for figure in figures if figure["row"] == fault.name]
        rows = "-".join(map(str, sorted({*fault.rows[:1], *fault.rows[-1:]})))
        runs, beyond = len({figure["test"] for figure in own}), sum(map(above, own))
        yield f"{rows:>7}  {runs:>4} {len(own):>7} {beyond:>5}  {fault.name}"


if __name__ == "__main__":
    sys.exit(main())
