"""Which branches of `estimator`, `drivers` and each room of `tools` the tests take: `python -m
gritd.tools.dev.coverage` [--jobs J] [--from FILE]. Writes its part of docs/reliability.md.

The daemons and commands that tests start as processes of their own are measured too, where they
end by themselves.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gritd.tools.cli.command import DONE, FAILED, Parser, whole

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reliability.md"
BEGIN = "<!-- from here on written by `python -m gritd.tools.dev.coverage` -->\n"
END = "<!-- to here -->\n"
DEMANDED = ("estimator", "drivers")
LEAST = 95.0  # [%] of the branches of each of them
# what a user of these two does; and of the rest what `make test` has, since whole campaigns take
# hours under a tracer
RUNS: tuple[tuple[str, ...], ...] = (
    (
        "tests/estimator",
        "tests/drivers",
        "tests/wires",
        "tests/scenarios",
        "tests/tools/commands",
        "tests/tools/service",
        "tests/test_interface.py",
    ),
    ("tests/tools", "tests/wording", "-m", "not long and not slow"),
)
# a tracer makes some of them several times slower and larger: times, memory, long computations,
# and a daemon that must keep up with 250 Hz
UNTRACED = (
    *(
        f"tests/scenarios/test_{name}.py"
        for name in (
            *("bed", "can", "clocks", "configuration", "journal"),
            *("limits", "loop", "memory", "soil_changes", "starvation", "threads", "trust"),
        )
    ),
    "tests/tools/commands/test_bench.py",
)


class Covered(NamedTuple):
    """Branches of a file or a package that some test takes, and all there are."""

    taken: int
    all: int

    @property
    def percent(self) -> float:
        """100 where there is no branch."""
        return 100.0 * self.taken / self.all if self.all else 100.0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tests under coverage.py and write the page's part. Exit 1 if a test fails, without a
    page, or if a package is below its share.
    """
    parser = Parser(
        prog="python -m gritd.tools.dev.coverage",
        description="Branch coverage of estimator, drivers and tools, into docs/reliability.md.",
    )
    parser.add_argument(
        "--jobs", type=whole(1, 64), default=2, metavar="J", help="tests side by side"
    )
    parser.add_argument("--from", dest="report", metavar="FILE", help="a JSON report made before")
    arguments = parser.parse_args(argv)
    if arguments.report:
        return _write(Path(arguments.report))

    # nobody may write here as well: daemons of scenarios run as that user
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o777)
        report = Path(folder) / "report.json"
        return FAILED if _measure(Path(folder), report, arguments.jobs) else _write(report)


def _measure(folder: Path, report: Path, jobs: int) -> int:
    """The exit code of the tests, and the report of what they reached."""
    environment = {**os.environ, "COVERAGE_FILE": str(folder / "data")}

    def coverage(*arguments: str) -> int:
        command = [sys.executable, "-m", "coverage", *arguments]
        return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode

    left_out = [f"--ignore={path}" for path in UNTRACED]
    options = ("--quiet", "-n", str(jobs), *left_out)
    failed = max(coverage("run", "-m", "pytest", *options, *tests) for tests in RUNS)
    coverage("combine", "--quiet")
    return coverage("json", "--quiet", "-o", str(report)) or failed


def _write(path: Path) -> int:
    files = json.loads(path.read_text(encoding="utf-8"))["files"]
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(BEGIN)
    after = rest.partition(END)[2]
    part = "\n".join(["", *_table(files), ""])
    PAGE.write_text(f"{before}{BEGIN}{part}{END}{after}", encoding="utf-8")

    found = packages(files)
    low = [name for name in DEMANDED if found[name].percent < LEAST]
    for name in low:
        print(f"{name}: {found[name].percent:.1f} %, limit {LEAST:g} %", file=sys.stderr)
    return FAILED if low else DONE


def packages(files: Mapping[str, Mapping[str, Any]]) -> dict[str, Covered]:
    """Branches of each package or room of `tools`, from the `files` of a JSON report."""
    by_package: defaultdict[str, list[Covered]] = defaultdict(list)
    for name, file in files.items():
        by_package[_package(name)].append(_covered(file))
    return {
        name: Covered(sum(c.taken for c in each), sum(c.all for c in each))
        for name, each in sorted(by_package.items(), key=lambda item: item[0].startswith("tools"))
    }


def _package(file: str) -> str:
    """`estimator`, `drivers`, or `tools/ROOM`."""
    first, *rest = Path(file).parent.parts
    return "/".join((first, *rest[:1])) if first == "tools" else first


def _covered(file: Mapping[str, Any]) -> Covered:
    summary = file["summary"]
    return Covered(summary["covered_branches"], summary["num_branches"])


def _table(files: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """The lines of the page."""
    yield "| package | branches | taken by some test | |"
    yield "|---|---|---|---|"
    for name, covered in packages(files).items():
        yield f"| `{name}` | {covered.all} | {covered.taken} | {covered.percent:.1f} % |"
    yield ""

    yield f"Files of which less than {LEAST:g} % is taken, and from where to where no test goes:"
    yield ""
    yield "| file | branches | taken | not taken: line → line |"
    yield "|---|---|---|---|"

    for name, file in sorted(files.items()):
        covered = _covered(file)
        if _package(name) in DEMANDED and covered.percent < LEAST:
            yield f"| `{name}` | {covered.all} | {covered.taken} | {_missing(file)} |"


def _missing(file: Mapping[str, Any]) -> str:
    ways = file["missing_branches"]
    return ", ".join(f"{a} → {b if b > 0 else 'end'}" for a, b in ways)


if __name__ == "__main__":
    sys.exit(main())
